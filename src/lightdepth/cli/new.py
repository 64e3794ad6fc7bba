"""`lightdepth new`: from any panorama to a first picture, without a question."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from lightdepth.quickstart.objects import NewObject
    from lightdepth.quickstart.place import GuessedPlace
    from lightdepth.quickstart.pose import GuessedPose
    from lightdepth.quickstart.spot import FloorSpot


def new(
    panorama: Annotated[Path, typer.Argument(help="The panorama: 360 x 180 degrees, .exr .hdr .jpg .png .tif.")],
    objects: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[OBJECT]...", help="Mesh files; without any, a chrome ball and a grey ball."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The scene file to begin; PANORAMA.toml by default.")
    ] = None,
    camera_height: Annotated[
        float | None,
        typer.Option(min=0.01, max=1000.0, metavar="M", help="Height of the lens above the floor, metres."),
    ] = None,
    place: Annotated[
        Literal["auto", "box", "dome", "ground"],
        typer.Option(help="What the place is: a room's box, a dome on the ground, or open ground under the sky."),
    ] = "auto",
    draft: Annotated[bool, typer.Option("--draft/--no-draft", help="Render a draft of the first picture.")] = True,
) -> None:
    """Begin a scene from a panorama and objects, and show them in it.

    Level and heading are found from straight edges, walls by a box fitted to the room's edges, free floor by its
    colour. What cannot be found is guessed. Every guess is a key in the scene file with a comment that says so.

    Example: lightdepth new room.exr bottle.glb -o room.toml --camera-height 1.45
    """
    from dataclasses import replace

    from rich.console import Console

    from lightdepth.errors import InputError
    from lightdepth.images.panorama_file import read_panorama
    from lightdepth.images.validation import find_defects, validate_panorama
    from lightdepth.images.writing import check_writable
    from lightdepth.parameters.quickstart import DEFAULT
    from lightdepth.quickstart.objects import default_objects, read_objects
    from lightdepth.quickstart.place import guess_place
    from lightdepth.quickstart.pose import guess_pose
    from lightdepth.quickstart.scene import group_width, write_first_scene
    from lightdepth.quickstart.spot import find_floor_spot

    console = Console(stderr=True, highlight=False, soft_wrap=True)
    scene = output or Path(f"{panorama.stem}.toml")
    if scene.suffix.lower() != ".toml":
        raise InputError(f"-o {scene}: '{scene.suffix}' is not allowed; a scene file ends in .toml")
    if scene.exists():
        raise InputError(
            f"-o {scene}: exists already; `new` starts a scene file and never replaces one. Give another name"
        )
    check_writable(scene)
    image = read_panorama(panorama)
    radiance = validate_panorama(image.radiance, panorama, repair=True)
    pose = guess_pose(replace(image, radiance=radiance), camera_height)
    guessed = guess_place(radiance, pose, None if place == "auto" else place)
    room = float((guessed.high - guessed.low).min())
    things = read_objects(objects, DEFAULT.room_share * room) if objects else default_objects()
    group, deepest = group_width(things), max(float(thing.size[:2].max()) for thing in things)
    distance = pose.height * min(DEFAULT.shortest_view + group, DEFAULT.longest_view) + 0.5 * group
    spot = find_floor_spot(radiance, pose, guessed, 0.5 * group, 0.5 * deepest, distance)
    write_first_scene(scene, panorama, pose, guessed, things, spot, radiance)
    spoilt = [defect for defect in find_defects(image.radiance) if not defect.negligible]
    repairs = [f"{panorama}: {defect}; replaced here, and by `lightdepth render --repair`" for defect in spoilt]
    for note in (*image.notes, *repairs):
        console.print(f"warning: {note}", style="yellow", markup=False)
    _report(console, scene, pose, guessed, things, spot, camera_height)
    if draft:
        _draft(scene)


def _report(
    console: Console,
    scene: Path,
    pose: GuessedPose,
    place: GuessedPlace,
    things: list[NewObject],
    spot: FloorSpot,
    camera_height: float | None,
) -> None:
    from lightdepth.parameters.quickstart import DEFAULT

    console.print(f"level      {pose.rotation_words}", markup=False)
    if camera_height is None:
        console.print(
            f"warning: the camera's height is not known and taken as {pose.height:g} m; every size and distance scales "
            "with it: measure it and give --camera-height",
            style="yellow",
            markup=False,
        )
    elif not DEFAULT.lowest_camera <= camera_height <= DEFAULT.highest_camera:
        console.print(
            f"warning: a camera {camera_height:g} m above the floor is unusual; --camera-height is in metres",
            style="yellow",
            markup=False,
        )
    console.print(f"place      {place.words}", markup=False)
    free = "on free floor" if spot.is_free else "where the floor did not look free"
    x, y, _ = spot.point
    console.print(
        f"objects    {', '.join(thing.name for thing in things)}: {free}, at {x:.2f}, {y:.2f} m", markup=False
    )
    for thing in things:
        if thing.words:
            console.print(f"warning: {thing.name}: {thing.words}", style="yellow", markup=False)
    console.print(f"wrote {scene} with a folder of meshes; look for 'guess' in it", markup=False)


def _draft(scene: Path) -> None:
    """Render the first picture roughly."""
    import importlib.util

    from lightdepth.api import load_scene
    from lightdepth.cli.render import Interruption, Reporter, run
    from lightdepth.parameters.quickstart import DEFAULT
    from lightdepth.session.displays import ExrDisplay, PngDisplay
    from lightdepth.session.session import Job, Session

    target = scene.with_name(f"{scene.stem}-view.exr")
    files = [target, target.with_suffix(".png")]
    denoise = importlib.util.find_spec("mitsuba_oidn") is not None
    session = Session(load_scene(scene, repair=True), keep=False)
    session.display(ExrDisplay(target, []))
    session.display(PngDisplay(files[1]))
    with Interruption() as interruption, Reporter("bar", files) as reporter:
        run(session, Job("view", DEFAULT.samples, denoise=denoise, draft=True), reporter, interruption)
