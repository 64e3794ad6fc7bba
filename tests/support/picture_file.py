"""What docs/picture-file.md says of a picture's file, and what a file has beside it."""

import re
from pathlib import Path

import OpenEXR

ROOT = Path(__file__).parents[2]
OF_ANY_FILE = {
    "channels", "chunkCount", "compression", "dataWindow", "displayWindow", "lineOrder", "name", "pixelAspectRatio",
    "screenWindowCenter", "screenWindowWidth", "type", "version",
}  # fmt: skip


def documented():
    """Attributes, and channels by part, of the page's tables."""
    page = (ROOT / "docs/picture-file.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| `")]
    attributes = {name for cells in rows if len(cells) == 2 for name in re.findall(r"`([^`]+)`", cells[0])}
    channels = {name for cells in rows if len(cells) == 3 for name in re.findall(r"`([^`]+)`", cells[1])}
    return attributes, channels


def undocumented(path):
    """Attributes and channels that a file has and the page does not mention."""
    attributes, channels = documented()
    with OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
        has = {re.sub(r"^cryptomatte/.*", "cryptomatte/...", name) for part in file.parts for name in part.header}
        planes = {channel.name for part in file.parts for channel in part.header["channels"]}
    counted = re.compile(r"(Crypto\w+?)\d\d\.[RGBA]|(photograph\.share)\d+")
    planes = {counted.sub(lambda found: f"{found[1]}00.R" if found[1] else f"{found[2]}1", name) for name in planes}
    return (has - OF_ANY_FILE - attributes) | (planes - channels - {"CryptoMaterial00.R"})
