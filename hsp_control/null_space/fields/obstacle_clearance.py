"""The cost of links that come close to moving obstacles."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from typing import Annotated, Self

from pydantic import AfterValidator

from hsp_control.common.exceptions import FieldError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Name, Names, OrInstance, Positive
from hsp_control.geometry import LinkShape, Proximity, Proxy, link_shapes
from hsp_control.geometry.scene import Obstacle
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields.clearance import Clearance
from hsp_control.robot import Robot

ObstacleOrName = Annotated[str | Obstacle, OrInstance(Name, Obstacle)]
"""The name of an obstacle of the scene; in Python also the obstacle itself."""


class ObstacleClearance(Clearance, type="obstacle_clearance"):
    """f = Σ b(d_k / influence) over pairs of a link's shape and an obstacle."""

    obstacles: Annotated[Sequence[ObstacleOrName], AfterValidator(tuple)] | None = None
    """Names of the obstacles, which may move; or, in Python, the obstacles themselves
    [-]; all of the scene by default."""
    _: KW_ONLY
    influence: Positive = 0.2
    links: Names | None = None
    """Names of the links [-]; all moving links by default."""
    proxy: Proxy = "capsules"
    """Shapes that approximate the links [-]; for an obstacle that is not a sphere,
    ``capsules`` are replaced by spheres along them."""

    def __post_init__(self) -> None:
        """Check that there is an obstacle."""
        if self.obstacles is not None and not self.obstacles:
            with within("obstacles"):
                raise FieldError("needs at least one obstacle")

    def fitted(self, start: Start) -> Self:
        """Return the cost with its obstacles from the scene; see `Clearance.placed`."""
        if self.obstacles is None:
            if not start.scene:
                raise FieldError("the scene has no obstacle")
            return replace(self, obstacles=tuple(start.scene.values()))
        found = []
        for k, each in enumerate(self.obstacles):
            with within("obstacles", k):
                found.append(each if isinstance(each, Obstacle) else start.scene[each])
        return replace(self, obstacles=tuple(found))

    def _pairs(self, robot: Robot) -> Proximity:
        given = dict.fromkeys(self.obstacles or ())  # the same one twice counts once
        obstacles = [each for each in given if isinstance(each, Obstacle)]
        if not obstacles or len(obstacles) < len(given):
            raise self._not_placed("obstacles")
        rounded = [o for o in obstacles if o.shape.rounded]
        flat = [o for o in obstacles if not o.shape.rounded]
        flat_proxy: Proxy = "spheres" if self.proxy == "capsules" else self.proxy
        chosen = [(self.proxy, rounded), (flat_proxy, flat)]
        blocks = [(link_shapes(robot, kind), some) for kind, some in chosen if some]
        first = sum(len(block) for block, _ in blocks)  # index of an obstacle
        shapes: list[LinkShape] = []
        pairs: list[tuple[int, int]] = []
        for block, some in blocks:
            pairs += [
                (len(shapes) + i, first + k)
                for i in _moving_shapes(block, self.links)
                for k in range(len(some))
            ]
            shapes += block
            first += len(some)
        return Proximity(robot, shapes, [*rounded, *flat], pairs)


def _moving_shapes(
    shapes: Sequence[LinkShape], links: Sequence[str] | None
) -> list[int]:
    """Return the indices of the shapes of links that move and are among ``links``."""
    known = tuple(dict.fromkeys(shape.link for shape in shapes))
    for k, link in enumerate(links or ()):
        if link not in known:
            with within("links", k):
                raise FieldError(
                    f"link {link!r} has no geometry{did_you_mean(link, known)} "
                    f"(links with geometry: {listing(known)})"
                )
    return [
        i
        for i, shape in enumerate(shapes)
        if shape.joint > 0 and (links is None or shape.link in links)
    ]
