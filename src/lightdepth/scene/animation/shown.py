"""``animation``: which animation of a file is shown, and from where on."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from lightdepth.scene.moment import Moment
from lightdepth.scene.values import Name, Number, Table


class AnimationTable(Table):
    """``animation = "NAME"``, or a table.

    Attributes:
        name: of the animation in the file.
        offset: time in the animation at the sequence's first frame, seconds; in the tables at a frame, at that frame.
        speed: seconds of the animation in a second of the sequence; negative plays it backward.
        loop: begin it again where it ends; else its first and its last pose are held.
    """

    name: Name
    offset: Number = 0.0
    speed: Number = 1.0
    loop: Annotated[bool, Field(strict=True)] = False


def _of_name(value: Any) -> Any:
    return {"name": value} if isinstance(value, str) else value


def _at_moment(table: AnimationTable, info: ValidationInfo) -> AnimationTable:
    """The animation where it is at ``context["moment"]``."""
    moment: Moment | None = (info.context or {}).get("moment")
    if moment is None:
        return table
    return table.model_copy(update={"offset": table.offset + table.speed * moment.seconds})


ShownAnimation = Annotated[AnimationTable, BeforeValidator(_of_name), AfterValidator(_at_moment)]
