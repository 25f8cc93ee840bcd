"""Plastic cycles: a wire is bent to and fro a thousand times, each time from where the last left it."""

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, predict

CYCLES = 1000


@pytest.mark.slow
def test_a_thousand_plastic_cycles_neither_drift_nor_grow():
    wire = Cable(
        length=0.3, diameter=0.002, linear_density=0.02, bending_stiffness=2e-3, bending_damping=2e-5,
        yield_strain=0.004, memory_rate=30.0, hardening=0.3,
    )  # fmt: skip
    shape, side, kept = Straight(), 1.0, []
    for _ in range(2 * CYCLES):  # a cycle is one bend to either side
        path = Move(displacement=(0.0, 0.16 * side, 0.0) if kept else (-0.03, 0.08, 0.0), duration=0.5)
        scene = Scene(
            cable=wire,
            shape=shape,
            grasps=(Grasp(u=0.0, hold="tangent"), Grasp(u=0.27, path=path)),
            environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.2),
            quality=Quality(n_u=9, n_t=13, method="march", estimate=False),
        )
        prediction = predict(scene)
        assert prediction.status == "converged", prediction.message
        shape, side = prediction.shape_at(), -side
        assert prediction.material is not None
        kept.append(prediction.material.memory[-1, :, :2])
    largest = np.abs(np.array(kept)).max(axis=(1, 2))
    assert largest[-1] > 1.0  # [1/m]: it does yield
    # with kinematic hardening the cycle is a limit cycle: from its hundredth time on the same again
    np.testing.assert_allclose(largest[200::2], largest[-2], rtol=2e-2)
    np.testing.assert_allclose(largest[201::2], largest[-1], rtol=2e-2)
