"""XMP: the properties of a packet that tell of the camera, and no others.

A packet is XML of a stranger. It is read as a stream by defusedxml without document types and entities, at most
`MOST_BYTES` of it, and only listed properties are kept, so that a position or a serial number never gets any further.
A property may be an attribute, an element, or an array; the items of an array are joined by commas. The first of several
wins: of a phone's cameras that is the one the picture is from.

Source: ISO 16684-1 (XMP); the namespaces of Adobe (tiff, exif, aux, crs, xmpDM), Google (GPano; Dynamic Depth 1.0), DJI, Parrot
and Pix4D, each as its owner publishes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MOST_BYTES = 4 * 2**20
MOST_TEXT = 4096
MOST_DEPTH = 64

_CRS = (
    "AlreadyApplied HasCrop CropTop CropLeft CropBottom CropRight CropAngle PerspectiveVertical PerspectiveHorizontal "
    "PerspectiveRotate PerspectiveAspect PerspectiveScale PerspectiveX PerspectiveY PerspectiveUpright "
    "LensManualDistortionAmount LensProfileEnable"
)
_GPANO = (
    "ProjectionType UsePanoramaViewer CroppedAreaImageWidthPixels CroppedAreaImageHeightPixels FullPanoWidthPixels "
    "FullPanoHeightPixels CroppedAreaLeftPixels CroppedAreaTopPixels PosePitchDegrees PoseRollDegrees"
)
_DJI = (
    "RelativeAltitude GimbalPitchDegree GimbalRollDegree GimbalYawDegree CalibratedFocalLength CalibratedOpticalCenterX "
    "CalibratedOpticalCenterY DewarpData DewarpFlag"
)
_PIX4D = (
    "ModelType PrincipalPoint PerspectiveFocalLength PerspectiveFocalLengthUnits PerspectiveDistortion FisheyeAffineMatrix "
    "FisheyePolynomial Yaw Pitch Roll AboveGroundAltitude"
)
_EXIF = (
    "FocalLength FocalLengthIn35mmFilm PixelXDimension PixelYDimension FocalPlaneXResolution FocalPlaneYResolution "
    "FocalPlaneResolutionUnit DigitalZoomRatio FNumber ExposureTime SubjectDistance"
)
_MODEL = (
    "FocalLengthX FocalLengthY ImageWidth ImageHeight PrincipalPointX PrincipalPointY Skew PixelAspectRatio Distortion "
    "DistortionCount"
)
Wanted = Mapping[str, tuple[str, frozenset[str]]]
WANTED: Wanted = {
    uri: (prefix, frozenset(names.split()))
    for uri, prefix, names in (
        ("http://ns.adobe.com/camera-raw-settings/1.0", "crs", _CRS),
        ("http://ns.google.com/photos/1.0/panorama", "GPano", _GPANO),
        ("http://www.dji.com/drone-dji/1.0", "drone-dji", _DJI),
        (
            "http://www.parrot.com/drone-parrot/1.0",
            "drone-parrot",
            "CameraPitchDegree CameraRollDegree CameraYawDegree",
        ),
        ("http://pix4d.com/camera/1.0", "Camera", _PIX4D),
        ("http://ns.google.com/photos/dd/1.0/imagingmodel", "ImagingModel", _MODEL),
        ("http://ns.adobe.com/tiff/1.0", "tiff", "Make Model Software"),
        ("http://ns.adobe.com/exif/1.0", "exif", _EXIF),
        ("http://cipa.jp/exif/1.0", "exifEX", "LensModel LensMake"),
        ("http://ns.adobe.com/exif/1.0/aux", "aux", "Lens"),
        ("http://ns.adobe.com/xap/1.0", "xmp", "CreatorTool"),
        ("http://ns.adobe.com/xmp/1.0/DynamicMedia", "xmpDM", "videoFrameRate videoFrameSize videoCompressor"),
    )
}
"""Namespace, without a slash at its end, to its usual prefix and the properties that are kept."""
_ITEM = "{http://www.w3.org/1999/02/22-rdf-syntax-ns#}li"


def camera_properties(packet: bytes) -> dict[str, str] | None:
    """What tells of the camera, by the usual prefixed names; None where the packet is no XML, has a DTD, or is too long."""
    return properties(packet, WANTED)


def properties(packet: bytes, wanted: Wanted) -> dict[str, str] | None:
    """The wanted properties of a packet; None as above."""
    from defusedxml.common import DefusedXmlException
    from defusedxml.ElementTree import DefusedXMLParser, ParseError

    if len(packet) > MOST_BYTES:
        return None
    kept = _Kept(wanted)
    parser = DefusedXMLParser(target=kept, forbid_dtd=True)
    try:
        # some writers end a packet with zeros or pad it in front
        parser.feed(packet.strip(b"\0 \t\r\n"))
        parser.close()
    except (ParseError, DefusedXmlException, ValueError, LookupError, _TooDeepError):
        return None
    return kept.found


class _TooDeepError(Exception):
    """Elements within elements, more than any writer makes."""


class _Kept:
    """The target of the parser: keeps what is wanted, and no tree."""

    def __init__(self, wanted: Wanted) -> None:
        self._wanted = wanted
        self.found: dict[str, str] = {}
        self._open: list[str | None] = []
        self._text: list[str] = []
        self._items: list[str] = []

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        if len(self._open) >= MOST_DEPTH:
            raise _TooDeepError
        self._open.append(self._name(tag))
        self._text = []
        if self._open[-1]:
            self._items = []
        for key, value in attributes.items():
            self._keep(self._name(key), value)

    def data(self, text: str) -> None:
        self._text.append(text)

    def end(self, tag: str) -> None:
        name = self._open.pop()
        text = "".join(self._text)[:MOST_TEXT].strip()
        self._text = []
        if tag == _ITEM and text:
            self._items.append(text)
        elif name:
            self._keep(name, text or ",".join(self._items))

    def close(self) -> dict[str, str]:
        return self.found

    def _keep(self, name: str | None, value: str) -> None:
        shown = "".join(c for c in value[:MOST_TEXT] if c.isprintable()).strip()
        if name and shown:
            self.found.setdefault(name, shown)

    def _name(self, tag: Any) -> str | None:
        """The usual prefixed name of a wanted property; None for any other."""
        if not isinstance(tag, str) or not tag.startswith("{"):
            return None
        uri, _, local = tag[1:].partition("}")
        prefix, names = self._wanted.get(uri.rstrip("/"), ("", frozenset()))
        return f"{prefix}:{local}" if local in names else None
