"""A viser server that listens where it should, and takes no orders from other websites."""

import http
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from typing import Any, Final
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server
from viser import _messages

from sain_core.errors import BusyError
from sain_core.view.palette import PALETTE, rgba
from sain_live.settings import PageConfig, check_free, is_loopback

TITLE: Final = "SAIN live"
CAMERA: Final = (1.50, -0.80, 1.00)  # [m], in front of the table, to its right
LOOK_AT: Final = (0.46, 0.0, 0.17)
FIELD_OF_VIEW: Final = 0.72  # [rad]
AMBIENT: Final = 0.3  # brightness of lights
SKY: Final = 0.7
PANEL_WIDTH: Final = 330  # pixels
UNFRAMED: Final = {"Content-Security-Policy": "frame-ancestors 'none'", "X-Frame-Options": "DENY"}
ON_A_PHONE: Final = """<style>@media (max-width: 36em) {
div:has(> .mantine-Paper-root[style*="20em"]) { flex-direction: column }
div:has(~ .mantine-Paper-root[style*="20em"]) { min-height: 0 }
.mantine-Paper-root[style*="20em"] { position: static !important; width: 100% !important;
  max-height: 50% !important; flex: none }
.mantine-Paper-root[style*="20em"] [style*="20em"] { width: 100% !important }
.mantine-ScrollArea-content { display: block !important; min-width: 0 !important; width: 100% }
.mantine-ScrollArea-content * { overflow-wrap: anywhere }
}</style>"""  # viser's panel covers the scene there; this puts it below, and as wide as the screen

Check = Callable[[Any, Any], Any]


def open_server(config: PageConfig) -> viser.ViserServer:
    """Return a server at the address of a page, with nothing on it.

    Raises:
        BusyError: the port is in use.
        ConfigError: this computer has no such address.
    """
    check_free(config.host, config.port)
    with _checked_requests(config.host), redirect_stdout(StringIO()):  # it prints addresses
        server = viser.ViserServer(config.host, config.port, label=TITLE, verbose=False)
    if server.get_port() != config.port:  # somebody was faster
        server.stop()
        raise BusyError(f"port {config.port} of {config.host} is in use; choose another port")
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)  # a tunnel to the internet
    _furnish(server)
    return server


def _furnish(server: viser.ViserServer) -> None:
    red, green, blue, _ = (round(255 * part) for part in rgba(PALETTE.mid))
    server.gui.configure_theme(
        show_logo=False, show_share_button=False, brand_color=(red, green, blue)
    )
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_WIDTH)
    server.gui.add_html(ON_A_PHONE)
    server.scene.set_up_direction("+z")
    server.scene.world_axes.visible = False
    # Without a graphics card, shadows and an environment map took a second for each picture.
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_ambient("/light/ambient", intensity=AMBIENT)
    server.scene.add_light_hemisphere("/light/sky", intensity=SKY)
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = CAMERA, LOOK_AT, FIELD_OF_VIEW


@contextmanager
def _checked_requests(host: str) -> Iterator[None]:
    """Have a server that is made meanwhile check who asks: viser itself does not."""
    module = websockets.asyncio.server
    serve = module.serve

    def checked(handler: Any, *where: Any, process_request: Check, **options: Any) -> Any:
        def check(connection: Any, request: Any) -> Any:
            if refused := refusal(host, request.headers):
                status, reason = refused
                response = connection.respond(status, reason + "\n")
            else:
                response = process_request(connection, request)
            if response is not None:  # else a websocket is opened
                response.headers.update(UNFRAMED)
            return response

        return serve(handler, *where, process_request=check, **options)

    module.serve = checked  # type: ignore[misc,assignment]
    try:
        yield
    finally:
        module.serve = serve  # type: ignore[misc]


def refusal(host: str, headers: Any) -> tuple[http.HTTPStatus, str] | None:
    """Return the status and the reason with which a request is refused; None: it is not.

    A browser lets any website connect to this computer, and names that site as the origin.
    """
    try:
        asked, origin = headers.get("Host", ""), headers.get("Origin")
        name = urlsplit(f"//{asked}").hostname or ""
    except (ValueError, LookupError):  # no host, or two of them
        return http.HTTPStatus.BAD_REQUEST, "the Host of the request is no address"
    if is_loopback(host) and not is_loopback(name):
        reason = f"this page is for this computer; open it as 127.0.0.1, not as {name!r}"
        return http.HTTPStatus.FORBIDDEN, reason
    if origin is not None and origin.partition("://")[2] != asked:
        return http.HTTPStatus.FORBIDDEN, f"{origin} may not use this page"
    return None
