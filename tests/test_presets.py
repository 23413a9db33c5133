import pytest

from subtense.errors import InputError
from subtense.presets import find_preset, presets


def test_the_named_classes_have_their_ranges():
    def limits(quantity, scale):
        half = quantity.u * 3**0.5
        return pytest.approx(((quantity.value - half) / scale, (quantity.value + half) / scale))

    phone, industrial = find_preset("smartphone"), find_preset("industrial")
    assert limits(phone.focal_length, 1e-3) == (4.0, 6.0)
    assert limits(phone.sensor_width, 1e-3) == (5.0, 7.0)
    assert limits(phone.image_width, 1.0) == (3000, 4000)
    assert limits(industrial.focal_length, 1e-3) == (8.0, 35.0)
    assert limits(industrial.sensor_width, 1e-3) == (8.8, 14.1)


@pytest.mark.parametrize(
    "name",
    [
        "1/2.3",
        '1/2.3"',
        "1/1.7",
        "1",
        "4/3",
        "aps-c-canon",
        "APS-C Nikon",
        "full-frame",
        "2/3",
        "1/1.8",
        "1/2.5",
        "IMX477",
    ],
)
def test_common_sensors_are_known_by_their_names(name):
    assert 2e-3 < find_preset(name).sensor_width.value < 50e-3


def test_every_row_has_a_source_and_a_doubt():
    for preset in presets().values():
        assert preset.source
        assert preset.sensor_width.u > 0 or preset.name == "full-frame-camera"


def test_an_unknown_name_is_answered_with_near_ones():
    with pytest.raises(InputError, match="smartphone"):
        find_preset("smartfone")
