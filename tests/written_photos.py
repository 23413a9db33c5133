"""Pictures with metadata, written by Pillow and its plug-ins: EXIF by tag name, XMP as packets."""

from PIL import Image
from PIL.TiffImagePlugin import IFDRational

NAMESPACES = {
    "crs": "http://ns.adobe.com/camera-raw-settings/1.0/", "GPano": "http://ns.google.com/photos/1.0/panorama/",
    "drone-dji": "http://www.dji.com/drone-dji/1.0/", "Camera": "http://pix4d.com/camera/1.0",
    "drone-parrot": "http://www.parrot.com/drone-parrot/1.0/", "ImagingModel": "http://ns.google.com/photos/dd/1.0/imagingmodel/",
    "tiff": "http://ns.adobe.com/tiff/1.0/", "exif": "http://ns.adobe.com/exif/1.0/", "exifEX": "http://cipa.jp/exif/1.0/",
    "aux": "http://ns.adobe.com/exif/1.0/aux/", "xmpDM": "http://ns.adobe.com/xmp/1.0/DynamicMedia/",
    "xmp": "http://ns.adobe.com/xap/1.0/",
}  # fmt: skip
TAGS = {
    "make": 0x010F, "model": 0x0110, "turn": 0x0112, "x_res": 0x011A, "y_res": 0x011B, "software": 0x0131,
    "exposure": 0x829A, "f_number": 0x829D, "distance": 0x9206, "focal": 0x920A, "note": 0x927C, "width": 0xA002, "height": 0xA003,
    "fp_x": 0xA20E, "fp_y": 0xA20F, "fp_unit": 0xA210, "rendered": 0xA401, "zoom": 0xA404, "f35": 0xA405, "lens_spec": 0xA432,
    "lens": 0xA434, "body_serial": 0xA431, "lens_serial": 0xA435,
}  # fmt: skip
FIRST = {"make", "model", "turn", "x_res", "y_res", "software"}
"""Of the first directory; the others stand in the Exif directory."""


def rational(value):
    return IFDRational(round(value * 10**4), 10**4)


def exif(**tags):
    """An EXIF block; a float becomes a fraction."""
    found = Image.Exif()
    ifd = found.get_ifd(0x8769)
    for name, value in tags.items():
        if isinstance(value, tuple):
            value = tuple(rational(one) for one in value)
        (found if name in FIRST else ifd)[TAGS[name]] = rational(value) if isinstance(value, float) else value
    return found


def packet(elements="", **attributes):
    """An XMP packet of attributes named prefix_Name, and elements."""
    said = " ".join(f'{k.replace("_", "-", k.count("_") - 1).replace("_", ":")}="{v}"' for k, v in attributes.items())
    spaces = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in NAMESPACES.items())
    return (f'<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
            f'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" {spaces} {said}>{elements}'
            '</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>').encode()  # fmt: skip


def write(path, size=(400, 300), xmp=None, pixels=None, form=None, **tags):
    """Write a picture in the format of the path's ending."""
    picture = Image.new("RGB", size, "gray") if pixels is None else Image.fromarray(pixels)
    form = form or {"jpg": "JPEG", "png": "PNG", "tif": "TIFF", "webp": "WEBP"}[path.suffix[1:]]
    more = {}
    if xmp is not None and form == "PNG":
        from PIL.PngImagePlugin import PngInfo

        more["pnginfo"] = PngInfo()
        more["pnginfo"].add_itxt("XML:com.adobe.xmp", xmp.decode())
    elif xmp is not None and form != "TIFF":
        more["xmp"] = xmp
    block = exif(**tags)
    if form == "TIFF":
        block[0x8769] = dict(block.get_ifd(0x8769))  # its writer looks for the directory among the tags
        block[0x02BC] = xmp or b""
    picture.save(path, form, exif=block, **more)
    return path
