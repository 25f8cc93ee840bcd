"""What the commands of ``dlo`` do."""

import ipaddress
import json as stdlib_json
import math
import sys
import time
from pathlib import Path
from typing import Any

import orjson
from pydantic import ValidationError

from app.http.fields import BadField, bad_fields
from app.schemas import PredictionRequest, from_prediction, to_scene
from app.schemas.surroundings import QualityModel
from app.settings import Settings
from dlocore import Iteration, Prediction, Scene, SceneError
from dlocore.scene.scene import Method
from dlocore.words import in_mm

BAD_INPUT, NOT_CONVERGED = 2, 3


class CommandError(Exception):
    """A command that can't go on; the message is for the person who ran it."""

    def __init__(self, message: str, exit_code: int = BAD_INPUT) -> None:
        super().__init__(message)
        self.exit_code = exit_code


def serve(host: str | None, port: int | None) -> int:
    """Run the service until it is stopped."""
    import uvicorn

    given = {name: value for name, value in (("host", host), ("port", port)) if value is not None}
    settings = _settings(**given)
    _settings()  # what the environment says must be right even where an option overrides it
    from app import logs
    from app.main import create_app

    # one process: the 3D scene and the queue of solves live in it; viser compresses nothing, so neither do we
    config = uvicorn.Config(
        create_app(settings),
        host=settings.host,
        port=settings.port,
        log_config=logs.configuration(settings.log_format),
        access_log=False,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=math.ceil(settings.shutdown_grace),
    )
    socket = config.bind_socket()
    where = f"[{settings.host}]" if ":" in settings.host else settings.host
    address = f"http://{where}:{socket.getsockname()[1]}"
    print(f"page      {address}/\n3D scene  {address}/scene/\nAPI docs  {address}/docs", flush=True)
    if settings.token is None and not _is_loopback(settings.host):
        print("warning   anyone who reaches this address can use it; DLO_TOKEN asks for a token", file=sys.stderr)
    print(f"runs      {settings.data_dir / 'runs'}", flush=True)
    uvicorn.Server(config).run(sockets=[socket])
    return 0


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def predict(scene: str, *, npz: str | None, json: str | None, rrd: str | None, method: Method | None = None) -> int:
    """Predict one scene, write what is asked for, and say how it went on stderr."""
    raw = _read(scene)
    request = _request(raw)
    if method is not None:
        request = _by(request, method)
        raw = request.model_dump_json(exclude_unset=True).encode()
    prediction = _solve(request)
    document = from_prediction(prediction, "", request.output.samples_u, request.output.samples_t)
    del document["links"], document["id"], document["state"]
    if npz is not None:
        from app.archive import surface_npz

        write_output(npz, surface_npz(document, prediction.material))
    if json is not None:
        write_output(json, orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY))
    if rrd is not None:
        _record(rrd, request_json=stdlib_json.loads(raw), document=document, prediction=prediction)
    print(summary(prediction), file=sys.stderr)
    return 0 if prediction.status == "converged" else NOT_CONVERGED


def calibrate(*, repeats: int, json: str | None) -> int:
    """Measure this machine, keep the result, and print it."""
    from tqdm import tqdm

    from dlocore import calibration
    from dlocore.study.calibrating import measure

    if repeats < 1:
        raise CommandError(f"--repeats: got {repeats}. Allowed: at least 1.")
    path = _settings().calibration_file if json is None else Path(json)
    with tqdm(desc="calibrating", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:

        def show(done: int, total: int, what: str) -> None:
            bar.total = total
            bar.set_postfix_str(what)
            bar.update(done - bar.n)

        found = measure(repeats=repeats, on_progress=show)
    try:
        found.save(path)
    except OSError as error:
        raise CommandError(f"can't write {path}: {error.strerror}", exit_code=1) from None
    print(calibration.table(found))
    print(f"kept in {path}", file=sys.stderr)
    return 0


def warmup() -> int:
    """Compile the solver."""
    from dlocore import warm_up

    began = time.perf_counter()
    warm_up()
    print(f"solver compiled in {time.perf_counter() - began:.1f} s", file=sys.stderr)
    return 0


def summary(prediction: Prediction) -> str:
    """Return status, method, error, time and active effects in a few lines."""
    accuracy = prediction.accuracy
    error = "unknown" if accuracy.error_estimate is None else in_mm(accuracy.error_estimate, 3)
    active = ", ".join(effect.name for effect in prediction.effects if effect.active)
    return "\n".join(
        [
            f"{prediction.status}: {prediction.message}",
            f"method   {accuracy.method}, {accuracy.n_u} x {accuracy.n_t} control points",
            f"motion   {accuracy.dimensions}D: {accuracy.dimensions_reason}",
            f"error    {error} (estimated, worst point)",
            f"time     {1e3 * accuracy.wall_time:.3g} ms",
            f"effects  {active}",
        ]
    )


def _settings(**given: Any) -> Settings:
    try:
        return Settings(**given)
    except ValidationError as error:
        first = error.errors()[0]
        name = "_".join(str(part) for part in first["loc"])
        raise CommandError(f"setting {name} (DLO_{name.upper()}): {first['msg']}") from None


def _read(scene: str) -> bytes:
    if scene == "-":
        return sys.stdin.buffer.read()
    try:
        return Path(scene).read_bytes()
    except OSError as error:
        raise CommandError(f"can't read {scene}: {error.strerror}") from None


def _request(raw: bytes) -> PredictionRequest:
    try:
        body = stdlib_json.loads(raw)  # takes NaN too, which the schema then refuses by name
    except (ValueError, RecursionError) as error:
        raise CommandError(f"the scene is not JSON: {error}") from None
    try:
        return PredictionRequest.model_validate(body)
    except ValidationError as error:
        raise CommandError(_words(bad_fields(error.errors(), body))) from None


def _by(request: PredictionRequest, method: Method) -> PredictionRequest:
    """Return the request solved by another method; the reference has no grid and no time budget of its own."""
    given = {} if isinstance(request.quality, str) else request.quality.model_dump(exclude_unset=True)
    if method == "reference":
        given = {name: value for name, value in given.items() if name == "target_error"}
    return request.model_copy(update={"quality": QualityModel(**{**given, "method": method})})


def _words(fields: list[BadField]) -> str:
    lines = [f"{field.field}: {field.message}" for field in fields]
    return "\n     ".join(lines)


def read_scene(file: str) -> Scene:
    """Return the scene of a JSON file, "-" for standard input."""
    try:
        return to_scene(_request(_read(file)), _stored)
    except SceneError as error:
        raise CommandError(_words([BadField.from_scene_error(error)])) from None


def _stored(id: str) -> Any:
    from app.store.runs import RunStore

    return RunStore(_settings()).motion(id)


def _solve(request: PredictionRequest) -> Prediction:
    from tqdm import tqdm

    from dlocore import predict as solve
    from dlocore import warm_up
    from dlocore.calibration import stored_cost

    with tqdm(desc="solving", unit=" iterations", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:

        def show(iteration: Iteration) -> None:
            bar.set_postfix(update=f"{iteration.update:.2g} m", residual=f"{iteration.residual:.2g}")
            bar.update()

        try:
            scene = to_scene(request, _stored)
            warm_up()  # so that the reported time is that of the solve
            cost = stored_cost(_settings().calibration_file) if scene.quality.time_budget is not None else None
            return solve(scene, on_iteration=show, cost=cost)
        except SceneError as error:
            raise CommandError(_words([BadField.from_scene_error(error)])) from None


def _record(rrd: str, *, request_json: dict[str, Any], document: dict[str, Any], prediction: Prediction) -> None:
    from app.archive import Run
    from app.recording import layout, write_recording

    path = Path(rrd)
    run = Run.of(request_json, {**document, "id": path.stem}, prediction)
    try:
        write_recording(run, path)
    except (OSError, RuntimeError) as error:
        raise CommandError(f"can't write {rrd}: {error}", exit_code=1) from None
    write_output(str(path.with_suffix(".rbl")), layout())


def write_output(path: str, content: bytes) -> None:
    """Write a file, "-" for standard output."""
    if path == "-":
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
        return
    try:
        Path(path).write_bytes(content)
    except OSError as error:
        raise CommandError(f"can't write {path}: {error.strerror}", exit_code=1) from None
