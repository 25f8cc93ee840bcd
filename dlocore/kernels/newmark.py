"""The coefficients of a time step, shared by everything that steps through a motion."""

from dlocore.compiling.kernel import law


@law
def coefficients(rho: float, jumps: bool) -> tuple[float, float, float, float]:
    """Return (alpha_m, alpha_f, gamma, beta) of a step of spectral radius `rho` at infinite frequency.

    This is the generalised-alpha method (Chung and Hulbert, 1993). Where forces jump, as those of contact do, they are
    balanced at the end of the step, alpha_f = 0: the method of Wood, Bossak and Zienkiewicz (1980), with the same gamma
    and beta. Both methods are of second order, and they are identical for rho = 0.
    """
    apart = (rho - 1.0) / (rho + 1.0)
    alpha_f = 0.0 if jumps else rho / (rho + 1.0)
    return apart + alpha_f, alpha_f, 0.5 - apart, 0.25 * (1.0 - apart) ** 2
