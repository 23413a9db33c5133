"""A HEIC as Pillow's plug-in writes it, with boxes put into its properties: a camera matrix, a quarter turn."""

import io
import struct

from PIL import Image


def heic(size=(400, 300), properties=(), pixels=None, **save):
    """The bytes of a HEIC of one picture whose item has these boxes besides its own."""
    import pillow_heif

    pillow_heif.register_heif_opener()
    out = io.BytesIO()
    (Image.new("RGB", size, "gray") if pixels is None else Image.fromarray(pixels)).save(out, "HEIF", **save)
    return _with_properties(out.getvalue(), properties)


def cmin(focal, centre_x, centre_y, shift=20):
    """Focal length in picture widths, principal point in widths and heights (ISO/IEC 23008-12)."""
    values = (round(v * 2**shift) for v in (focal, centre_x, centre_y))
    return struct.pack(">L4sLlll", 24, b"cmin", shift << 8, *values)


def irot(quarter_turns):
    """Turned counter-clockwise."""
    return struct.pack(">L4sB", 9, b"irot", quarter_turns)


def _find(data, start, end, kind):
    while start < end:
        size, name = struct.unpack_from(">L4s", data, start)
        if name == kind:
            return start, size
        start += size
    raise AssertionError(kind)


def _with_properties(data, properties):
    data = bytearray(data)
    meta, meta_size = _find(data, 0, len(data), b"meta")
    iloc, _ = _find(data, meta + 12, meta + meta_size, b"iloc")
    iprp, iprp_size = _find(data, meta + 12, meta + meta_size, b"iprp")
    ipco, ipco_size = _find(data, iprp + 8, iprp + iprp_size, b"ipco")
    ipma, ipma_size = _find(data, iprp + 8, iprp + iprp_size, b"ipma")
    count = _count(data, ipco + 8, ipco + ipco_size)
    more = b"".join(properties)
    grown = len(more) + len(properties)
    at = iloc + 16
    for _ in range(struct.unpack_from(">H", data, iloc + 14)[0]):  # all offsets are from the file's start
        offset = struct.unpack_from(">L", data, at + 4)[0]
        struct.pack_into(">L", data, at + 4, offset + grown)
        at += 18
    for box, by in ((meta, grown), (iprp, grown), (ipco, len(more)), (ipma, len(properties))):
        struct.pack_into(">L", data, box, struct.unpack_from(">L", data, box)[0] + by)
    data[ipma + 18] += len(properties)
    data[ipma + ipma_size : ipma + ipma_size] = bytes(0x80 | (count + 1 + i) for i in range(len(properties)))
    data[ipco + ipco_size : ipco + ipco_size] = more
    return bytes(data)


def _count(data, start, end):
    count = 0
    while start < end:
        start += struct.unpack_from(">L", data, start)[0]
        count += 1
    return count


def imir(axis):
    """Mirrored: 1 left to right, 0 top to bottom."""
    return struct.pack(">L4sB", 9, b"imir", axis)


def clap(width, height, right, down):
    """Cut to a size, its middle so far from the picture's."""
    return struct.pack(">L4sLLLLlLlL", 40, b"clap", width, 1, height, 1, right, 1, down, 1)
