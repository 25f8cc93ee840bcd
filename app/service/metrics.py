"""Counters of the service, for Prometheus."""

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector, generate_latest

from app.service.worker import Worker
from app.store.runs import RunStore
from dlocore import Prediction

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_TIMES = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)  # s


class Metrics:
    """Counters and gauges of one service.

    Args:
        worker: the worker whose queue is shown.
        runs: the store whose size is shown.
    """

    def __init__(self, worker: Worker, runs: RunStore) -> None:
        self._registry = CollectorRegistry()
        ProcessCollector(registry=self._registry)
        self._solves = Counter("dlo_solves", "Solves by outcome.", ["status", "method"], registry=self._registry)
        self._iterations = Counter(
            "dlo_iterations", "Iterations, or refinement levels of a march.", ["method"], registry=self._registry
        )
        self._seconds = Histogram(
            "dlo_solve_seconds", "Time of a solve.", ["method"], buckets=_TIMES, registry=self._registry
        )
        for name, text, value in (
            ("dlo_queue_depth", "Solves that are waiting for a worker.", lambda: worker.waiting),
            ("dlo_running", "Solves that are running.", lambda: worker.running),
            ("dlo_workers", "Solves that may run at once.", lambda: worker.workers),
            ("dlo_stored_runs", "Stored runs.", lambda: runs.size[0]),
            ("dlo_stored_bytes", "Bytes of the stored runs.", lambda: runs.size[1]),
        ):
            Gauge(name, text, registry=self._registry).set_function(value)

    def solved(self, prediction: Prediction) -> None:
        """Count a solve that gave an answer."""
        accuracy = prediction.accuracy
        self._solves.labels(prediction.status, accuracy.method).inc()
        self._iterations.labels(accuracy.method).inc(len(prediction.iterations))
        self._seconds.labels(accuracy.method).observe(accuracy.wall_time)

    def ended(self, status: str, method: str) -> None:
        """Count a solve without an answer ("refused", "cancelled", "time_limit" or "failed") by requested method."""
        self._solves.labels(status, method).inc()

    def text(self) -> bytes:
        """Return the metrics in the Prometheus text format."""
        return generate_latest(self._registry)
