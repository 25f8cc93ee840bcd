"""``/rerun/``: the web viewer of rerun, served from here so that it works offline."""

import anyio.to_thread
from fastapi import APIRouter
from fastapi.responses import FileResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from app.pages.rerun_files import FILES, viewer_files
from app.recording import layout
from app.service.service import TheService

router = APIRouter(prefix="/rerun", include_in_schema=False)


@router.get("")
async def slash() -> Response:
    """Redirect to the address with a slash, which the page's relative links need."""
    return RedirectResponse("/rerun/", 307)


@router.get("/layout.rbl")
async def viewer_layout() -> Response:
    """Return the layout in which recordings open."""
    return Response(await anyio.to_thread.run_sync(layout), media_type="application/octet-stream")


@router.get("/{name:path}")
async def file(name: str, service: TheService) -> Response:
    """Return a file of the viewer; ``?url=`` names the recordings that it opens."""
    name = name or "index.html"
    if name not in FILES:
        raise HTTPException(404)
    directory = await anyio.to_thread.run_sync(viewer_files, service.settings.data_dir)
    return FileResponse(directory / name, media_type=FILES[name], headers={"Cache-Control": "max-age=3600"})
