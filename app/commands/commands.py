"""What the commands of ``dlo`` do."""

import json as stdlib_json
import math
import os
import re
import socket
import sys
import time
from pathlib import Path
from typing import Any

import orjson
from pydantic import ValidationError
from pydantic_settings import SettingsError

from app.commands.bar import progress_bar
from app.commands.errors import FAILED, NOT_CONVERGED, CommandError, in_lines
from app.commands.files import STANDARD, check_outputs, for_people, is_device, read_input, write_output
from app.http.access import is_loopback
from app.http.fields import BadField, bad_fields
from app.schemas import PredictionRequest, from_prediction, to_scene
from app.schemas.surroundings import QualityModel
from app.settings import Settings
from dlocore import Iteration, Prediction, Scene, SceneError
from dlocore.errors import repeated
from dlocore.files import whole
from dlocore.scene.scene import Method
from dlocore.words import in_mm, in_ms

_TO_ANSWER = 3  # s beyond the grace, to answer the requests that were cancelled


def serve(host: str | None, port: int | None) -> int:
    """Run the service until it is stopped."""
    import uvicorn

    given = {name: value for name, value in (("host", host), ("port", port)) if value is not None}
    settings = _settings(**given)
    _settings()  # the environment must be valid even where an option overrides it
    from app import logs
    from app.main import create_app

    _check_data_dir(settings.data_dir)
    listening = _listening(settings.host, settings.port)
    # one process, because the 3D scene and the queue of solves live in it; viser compresses nothing, so neither do we
    config = uvicorn.Config(
        create_app(settings),
        log_config=logs.configuration(settings.log_format),
        access_log=False,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=math.ceil(settings.shutdown_grace) + _TO_ANSWER,
    )
    where = f"[{settings.host}]" if ":" in settings.host else settings.host
    address = f"http://{where}:{listening.getsockname()[1]}"
    print(f"page      {address}/\n3D scene  {address}/scene/\nAPI docs  {address}/docs", flush=True)
    if settings.token is None and not is_loopback(settings.host):
        print("warning   anyone who can reach this address can use it; DLO_TOKEN requires a token", file=sys.stderr)
    print(f"runs      {settings.data_dir / 'runs'}", flush=True)
    uvicorn.Server(config).run(sockets=[listening])
    return 0


def _check_data_dir(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"DLO_DATA_DIR: can't create {folder}: {error.strerror}", FAILED) from None
    if not os.access(folder, os.W_OK):
        raise CommandError(f"DLO_DATA_DIR: can't write to {folder}", FAILED)


def _listening(host: str, port: int) -> socket.socket:
    """Return a socket that listens on a port of a host."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        reason = str(error.strerror).partition(" (")[0]  # the rest repeats the address
        raise CommandError(
            f"can't listen on port {port} of {host}: {reason}. --port 0 takes a free port.",
            FAILED,
        ) from None


def predict(
    scene: str,
    *,
    npz: str | None,
    json: str | None,
    rrd: str | None,
    method: Method | None = None,
    deadline: float | None = None,
) -> int:
    """Predict one scene, write the requested outputs, and print a summary to stderr; `deadline` limits the solve [s].

    Raises:
        CommandError: the scene, an output or the deadline is not possible.
    """
    if deadline is not None and not 0.0 < deadline < math.inf:
        raise CommandError(f"--deadline: got {deadline:g}. Allowed: a finite number above 0 [s].")
    _check_predict(scene, npz=npz, json=json, rrd=rrd)
    raw = read_input(scene)
    request = _request(raw)
    if method is not None:
        request = _by(request, method)
        raw = request.model_dump_json(exclude_unset=True).encode()
    prediction = _solve(request, deadline)
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


def _check_predict(scene: str, *, npz: str | None, json: str | None, rrd: str | None) -> None:
    if rrd == STANDARD:
        raise CommandError("--rrd: got -. Allowed: the name of a file.")
    check_outputs({"--output": npz, "--json": json, "--rrd": rrd}, [scene])
    if npz is not None and npz != STANDARD:
        _check_suffix("--output", npz, ".npz", "; the whole answer as JSON is written by --json")
    if rrd is not None:
        _check_suffix("--rrd", rrd, ".rrd")


def _check_suffix(option: str, path: str, suffix: str, advice: str = "") -> None:
    """Refuse a file whose name suggests another format; a device may have any name."""
    if Path(path).suffix.lower() != suffix and not is_device(path):
        raise CommandError(f"{option}: got {path}. Allowed: a name that ends in {suffix}{advice}.")


def calibrate(*, repeats: int, json: str | None) -> int:
    """Measure this machine, keep the result, and print it.

    Raises:
        CommandError: `repeats` is out of range, or the result can't be written.
    """
    from dlocore import calibration
    from dlocore.study.calibrating import measure
    from dlocore.study.plan import MAX_REPEATS

    if not 1 <= repeats <= MAX_REPEATS:
        raise CommandError(f"--repeats: got {repeats}. Allowed: 1 to {MAX_REPEATS}.")
    check_outputs({"--json": json})
    kept = _settings().calibration_file if json is None else None
    if kept is not None:
        _check_data_dir(kept.parent)
    with progress_bar("calibrating") as show:
        found = measure(repeats=repeats, on_progress=show)
    if json is not None:
        write_output(json, found.as_json())
    else:
        found.save(kept)
    print(calibration.table(found), file=for_people(json))
    print(f"kept in {json or kept}", file=sys.stderr)
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
    estimate = accuracy.error_estimate
    error = "unknown" if estimate is None else f"{in_mm(estimate, 3)} (estimated, worst point)"
    active = ", ".join(effect.name for effect in prediction.effects if effect.active)
    return "\n".join(
        [
            f"{prediction.status}: {prediction.message}",
            f"method   {accuracy.method}, {accuracy.n_u} x {accuracy.n_t} control points",
            f"motion   {accuracy.dimensions}D: {accuracy.dimensions_reason}",
            f"error    {error}",
            f"time     {in_ms(accuracy.wall_time)}",
            f"effects  {active}",
        ]
    )


def _settings(**given: Any) -> Settings:
    try:
        return Settings(**given)
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0])
        shown = "a secret" if name == "token" else repr(first["input"])
        origin = f"--{name}" if name in given else f"DLO_{name.upper()}"
        raise CommandError(f"{origin}: got {shown}. {first['msg']}: {_described(name)}") from None
    except SettingsError as error:  # a value that must be JSON is not
        name = re.findall(r'"(\w+)"', str(error))[0]
        shown = repr(os.environ.get(f"DLO_{name.upper()}"))
        raise CommandError(f"DLO_{name.upper()}: got {shown}. Allowed: {_described(name)}") from None


def _described(setting: str) -> str:
    return Settings.model_fields[setting].description or ""


def _request(raw: bytes) -> PredictionRequest:
    try:
        # also takes NaN, which the schema then refuses by field
        body = stdlib_json.loads(raw, object_pairs_hook=_with_each_name_once)
    except (ValueError, RecursionError) as error:
        raise CommandError(f"the scene is not JSON: {error}") from None
    try:
        return PredictionRequest.model_validate(body)
    except ValidationError as error:
        raise CommandError(in_lines(bad_fields(error.errors(), body))) from None


def _by(request: PredictionRequest, method: Method) -> PredictionRequest:
    """Return the request with another method; `reference` takes neither a grid nor a time budget."""
    given = {} if isinstance(request.quality, str) else request.quality.model_dump(exclude_unset=True)
    if method in ("spacetime", "paper") and given.get("n_u") is None:
        wanted = 'a scene whose quality gives the grid, such as {"n_u": 9, "n_t": 13, "delta": 1e-5}'
        raise CommandError(f"--method: got {method}. Allowed: march or reference, or {wanted}.")
    if method == "reference":
        given = {name: value for name, value in given.items() if name == "target_error"}
    return request.model_copy(update={"quality": QualityModel(**{**given, "method": method})})


def _with_each_name_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    twice = repeated(name for name, _ in pairs)
    if twice is not None:
        raise CommandError(f"the scene: got {twice!r} twice in one object. Allowed: each name once.")
    return dict(pairs)


def read_scene(file: str) -> Scene:
    """Return the scene of a JSON file, "-" for standard input.

    Raises:
        CommandError: it can't be read, or is not a scene that can be solved; the message names the file and the fault.
    """
    raw = read_input(file)
    try:
        return to_scene(_request(raw), _stored)
    except SceneError as error:
        raise CommandError(f"{file}: {in_lines([BadField.from_scene_error(error)])}") from None
    except CommandError as error:
        raise CommandError(f"{file}: {error}", error.exit_code) from None


def _stored(id: str) -> Any:
    from app.store.runs import motion_of

    return motion_of(_settings().data_dir, id)


def _solve(request: PredictionRequest, deadline: float | None) -> Prediction:
    from tqdm import tqdm

    from dlocore import predict as solve
    from dlocore.calibration import stored_cost
    from dlocore.warming import warm_up_for

    with tqdm(desc="solving", unit=" iterations", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:

        def show(iteration: Iteration) -> None:
            bar.set_postfix(update=f"{iteration.update:.2g} m", residual=f"{iteration.residual:.2g}")
            bar.update()

        try:
            scene = to_scene(request, _stored)
            warm_up_for(scene)  # so that the reported time is that of the solve alone
            cost = stored_cost(_settings().calibration_file) if scene.quality.time_budget is not None else None
            return solve(scene, on_iteration=show, deadline=deadline, cost=cost)
        except SceneError as error:
            raise CommandError(in_lines([BadField.from_scene_error(error)])) from None


def _record(rrd: str, *, request_json: dict[str, Any], document: dict[str, Any], prediction: Prediction) -> None:
    from app.archive import Run
    from app.recording import write_recording

    path = Path(rrd)
    run = Run.of(request_json, {**document, "id": ""}, prediction)
    try:
        with whole(path) as unfinished:
            write_recording(run, unfinished, name=path.stem)
    except OSError as error:
        raise CommandError(f"can't write {rrd}: {error.strerror or error}", FAILED) from None
