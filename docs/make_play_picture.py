"""Photograph the page of `hsp play`: `make animations` (the picture is committed)."""

import io
from pathlib import Path

import numpy as np
from PIL import Image

from hsp_control.companions.film.chromium import headless_browser
from hsp_control.companions.play import Session
from hsp_control.companions.play.playable import playable
from hsp_control.companions.viewer import Viewer
from hsp_control.companions.viewer.live_picture import Picture
from hsp_control.companions.viewer.transport import PageServer

FILE = Path(__file__).parent / "figures" / "play.webp"
SIZE = {"width": 1280, "height": 760}
ELBOW = "/robot/panda_joint4/panda_link4"


def main() -> None:
    """Drag the hand, then pull at the elbow, and photograph it in the pull."""
    session = Session(playable("panda_obstacle", "view.camera=[2.0,0.9,1.1]"))
    server = PageServer(steerable=True)
    view = session.experiment.scenario.view.all_fields()
    viewer = Viewer(session.experiment.robot, transport=server, **view)
    picture = Picture(session, viewer)

    def go(rows: int) -> None:
        for _ in range(rows):
            session.advance()

    with headless_browser() as browser:
        go(650)
        pose = np.array(session.handles.targets["hand"].where(session.controller.state))
        for _ in range(40):
            pose[:3] += [0.001, 0.004, 0.001]
            session.receive({"do": "move", "target": "hand", "pose": pose.tolist()})
            go(3)
        ball = {"do": "obstacle", "name": "ball", "position": [0.1, 0.45, 0.75]}
        session.receive(ball)
        go(200)
        point = session.controller.state.data.oMi[4].translation.copy()
        message = {"do": "pull", "path": ELBOW, "point": point.tolist()}
        for _ in range(150):
            hand = point + np.array([-0.05, -0.3, 0.12])
            session.receive(message | {"to": hand.tolist()})
            session.advance()
        page = browser.new_page(viewport=SIZE, device_scale_factor=1.5)
        page.goto(f"{server.url}&full")
        picture.draw(running=True, rate=1.0)
        viewer.wait_for_browser(60.0)
        page.evaluate("play.select('target hand')")
        page.wait_for_timeout(1500)  # plots are drawn 20 times a second
        data = page.screenshot()
    server.close()
    Image.open(io.BytesIO(data)).convert("RGB").save(FILE, quality=82, method=6)
    print(f"Picture: {FILE}, {FILE.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
