"""A camera of a simulated scene, whose pictures ``hsp live --cameras`` has."""

from typing import Any
from urllib.error import HTTPError
from urllib.parse import quote
from urllib.request import urlopen

import cv2
import numpy as np
from lerobot.cameras import Camera
from lerobot.utils.errors import DeviceNotConnectedError

from .config_hsp import HspCameraConfig


class HspCamera(Camera):
    """Requests a picture whenever one is needed: it shows the scene as it is then."""

    def __init__(self, config: HspCameraConfig) -> None:
        """Begin without a connection."""
        super().__init__(config)
        self.config = config
        path = f"{quote(config.camera, safe='')}.jpg"
        self._url = f"{config.url}/{path}?width={self.width}&height={self.height}"
        self._open = False

    @property
    def is_connected(self) -> bool:
        """Whether a picture was seen."""
        return self._open

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """Return nothing: the address of a simulation is not known."""
        return []

    def connect(self, warmup: bool = True) -> None:
        """Look for the first time.

        Raises:
            ConnectionError: Without an answer, or if the scene has no such camera.
        """
        self._picture()
        self._open = True

    def read(self, *_: Any) -> np.ndarray:
        """Return the camera's present picture, red first, shape (height, width, 3).

        Raises:
            ConnectionError: Without an answer.
        """
        if not self._open:
            raise DeviceNotConnectedError(f"{self} is not connected; call connect()")
        return self._picture()

    async_read = read_latest = read

    def disconnect(self) -> None:
        """Look no more."""
        self._open = False

    def _picture(self) -> np.ndarray:
        try:
            with urlopen(self._url, timeout=self.config.timeout) as answer:
                text = np.frombuffer(answer.read(), np.uint8)
        except HTTPError as error:
            page = error.read().decode(errors="replace").partition("explanation: ")[2]
            raise ConnectionError(f"{self._url}: {page.partition('</p>')[0]}") from None
        except OSError as error:
            raise ConnectionError(
                f"{self._url}: no picture ({error}); start a simulated arm with: "
                f"hsp live CONFIG --cameras {self.config.url}"
            ) from None
        return cv2.cvtColor(cv2.imdecode(text, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)

    def __str__(self) -> str:
        """Return its name."""
        return f"HspCamera({self.config.camera})"
