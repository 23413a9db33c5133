"""Things of known size: what the standards say, and a file of one's own."""

import itertools
import math

import pytest
from click.testing import CliRunner

from subtense.cli import main
from subtense.errors import FileFormatError, InputError
from subtense.networks.kinds import KINDS
from subtense.quantity import Quantity
from subtense.target import Target
from subtense.targets import find_target, search, targets

SHELF = """
[shelf]
title = "our shelf"
width_mm = 800
height_mm = 1200
tolerance_mm = [1, 2.5]
source = "tape"
"""

OF_MANY_KINDS = {name for kind in KINDS for name in (kind.target, *kind.others, *kind.stated)}
"""Rows for what a network calls a bottle or a child: they hold all of them, so they say little."""


def sides(target):
    return [side for side in (target.size, target.width, target.height) if side is not None]


def limits_mm(side):
    half = side.u * math.sqrt(3)
    return pytest.approx(((side.value - half) * 1e3, (side.value + half) * 1e3), abs=1e-9)


@pytest.fixture
def own(tmp_path):
    def write(text):
        path = tmp_path / "own.toml"
        path.write_text(text, "utf-8")
        return path

    return write


# -- the table ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("target", targets().values(), ids=lambda target: target.name)
def test_a_row_has_a_size_a_doubt_and_who_says_so(target):
    assert target.source and target.doubt and target.what and target.title and target.group != "own"
    assert len(sides(target)) == (2 if target.shape == "rectangle" else 1)
    most = 0.2 if target.name in OF_MANY_KINDS else 0.06
    for side in sides(target):
        assert side.unit == "m" and side.value > 0 and 0 < side.u < most * side.value
        assert side.distribution.name in ("uniform", "normal")
        assert side.source.startswith("assumed") == target.doubt.startswith("assumed")


@pytest.mark.parametrize("target", targets().values(), ids=lambda target: target.name)
def test_its_text_reads_back_to_the_same_quantity(target):
    texts = target.text.split(" x ")
    for text, side in zip(texts, sides(target), strict=True):
        read = Quantity.parse(text, "m")
        assert (read.value, read.u) == pytest.approx((side.value, side.u), rel=1e-9)
        assert read.distribution == side.distribution
    if target.shape == "rectangle":
        corners = Target.parse(f"rectangle {target.text}").points_m
        assert corners[2, :2] - corners[0, :2] == pytest.approx([target.width.value, target.height.value])


def test_names_are_used_once():
    names = [name for target in targets().values() for name in (target.name, *target.aliases)]
    assert len(names) == len(set(names))


def test_half_an_a_sheet_is_the_next_one():
    # ISO 216:2007, 3: the next size is the sheet folded once across; each is rounded to whole millimetres
    sheets = [targets()[f"a{n}"] for n in (2, 3, 4, 5, 6)]
    for large, small in itertools.pairwise(sheets):
        assert small.width.value == pytest.approx(large.height.value, abs=1e-12)
        assert small.height.value == pytest.approx(large.width.value / 2, abs=0.6e-3)
        assert large.width.value / large.height.value == pytest.approx(math.sqrt(2), rel=5e-3)


def test_a_sheets_have_the_tolerance_of_iso_216():
    # ISO 216:2007, 5: ±1.5 mm up to 150 mm, ±2 mm up to 600 mm
    for n in (2, 3, 4, 5, 6):
        for side in sides(targets()[f"a{n}"]):
            assert side.u * math.sqrt(3) == pytest.approx(1.5e-3 if side.value <= 0.150 else 2e-3)


def test_what_the_authorities_say():
    table = targets()
    # ISO/IEC 7810, ID-1: nominal 85.60 x 53.98 mm; an unused card 85.47 to 85.72 mm x 53.92 to 54.03 mm
    card = table["id-1"]
    assert (card.width.value, card.height.value) == pytest.approx((85.60e-3, 53.98e-3))
    for side, low, high in ((card.width, 85.47e-3, 85.72e-3), (card.height, 53.92e-3, 54.03e-3)):
        half = side.u * math.sqrt(3) + 1e-9
        assert side.value - half <= low and high <= side.value + half
    # ISO 216
    assert limits_mm(table["a4"].width) == (295, 299)
    assert limits_mm(table["a4"].height) == (208, 212)
    # Regulation (EU) No 729/2014, annex I
    cents = {"1-cent": 16.25, "2-cent": 18.75, "5-cent": 21.25, "10-cent": 19.75, "20-cent": 22.25, "50-cent": 24.25}
    for coin, diameter_mm in {**cents, "1": 23.25, "2": 25.75}.items():
        assert table[f"euro-{coin}"].size.value == pytest.approx(diameter_mm * 1e-3)
    # EN 13698-1
    assert (table["pallet-eur"].width.value, table["pallet-eur"].height.value) == pytest.approx((1.2, 0.8))
    # 31 U.S.C. 5112(a): inches
    for coin, inches in {
        "penny": 0.750,
        "nickel": 0.835,
        "dime": 0.705,
        "quarter": 0.955,
        "half-dollar": 1.205,
    }.items():
        assert table[f"us-{coin}"].size.value == pytest.approx(inches * 25.4e-3, abs=0.006e-3)
    # ISO 668: 6058 mm, not more and at most 6 mm less
    assert limits_mm(table["container-20ft"].width) == (6052, 6058)
    # circumferences of the rules of football, volleyball: the limits cover them and little more
    for ball, low_mm, high_mm in (("football", 680, 700), ("volleyball", 650, 670), ("basketball", 749, 780)):
        size, half = table[ball].size.value * 1e3, table[ball].size.u * 1e3 * math.sqrt(3)
        assert size - half == pytest.approx(low_mm / math.pi, abs=0.15)
        assert size + half == pytest.approx(high_mm / math.pi, abs=0.15)
    # Rüfer et al. 2005: 11.71 ± 0.42 mm is a spread, not limits
    assert (table["iris"].size.value, table["iris"].size.u) == pytest.approx((11.71e-3, 0.42e-3))
    assert table["iris"].size.distribution.name == "normal"


# -- finding -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "found"),
    [("id-1", "id-1"), ("Credit Card", "id-1"), ("DIN-A4", "a4"), ("A4 sheet", "a4"), ("soccer_ball", "football")],
)
def test_a_row_is_known_by_name_title_and_alias(name, found):
    assert find_target(name).name == found


def test_an_unknown_name_is_answered_with_near_ones():
    with pytest.raises(InputError, match=r"--object is 'pasport'.*id-3") as error:
        find_target("pasport", "--object")
    assert "\n" not in str(error.value)


def test_search_needs_every_word():
    coins = {name for name in targets() if name.startswith("euro-") and "note" not in name}
    assert {target.name for target in search("EURO coin")} == coins and len(coins) == 8
    assert [target.name for target in search(["passport"])] == ["id-3"]
    assert search("passport coin") == []
    assert len(search("")) == len(targets())


def test_a_menu_gets_texts():
    card, coin = find_target("id-1").to_json(), find_target("euro-1").to_json()
    assert {"name", "title", "group", "what", "shape", "source"} <= set(card)
    assert (card["size"], card["width"], card["height"]) == (
        None,
        "85.6 ± 0.13 mm (limits)",
        "53.98 ± 0.06 mm (limits)",
    )
    assert (coin["size"], coin["width"], coin["shape"]) == ("23.25 ± 0.1 mm (limits)", None, "circle")
    assert find_target("man-height").to_json()["text"].endswith("mm (1s)")


# -- a file of one's own -----------------------------------------------------------------------------------


def test_an_own_file_adds_and_replaces(own):
    path = own(SHELF + '[a4]\ntitle = "my A4"\nlength_mm = 297.2\nspread_mm = 0.1\nsource = "calliper"\n')
    table = targets(path)
    assert len(table) == len(targets()) + 1
    assert limits_mm(table["shelf"].width) == (799, 801)
    assert limits_mm(table["shelf"].height) == (1197.5, 1202.5)
    assert (table["a4"].title, table["a4"].text) == ("my A4", "297.2 ± 0.1 mm (1s)")
    assert find_target("Our shelf", extra=path).name == "shelf"
    assert [target.name for target in search("own", path) if target.group == "own"] == ["shelf", "a4"][::-1]
    assert targets()["a4"].title == "A4 sheet" and "shelf" not in targets()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[shelf\n", "is not TOML"),
        ("shelf = 3", "row shelf: is no table"),
        ('["Our shelf"]\n', "row 'Our shelf': write its name"),
        (SHELF.replace("800", "-800"), "row shelf: width_mm is '-800'; give a number"),
        (SHELF.replace("800", "nan"), "row shelf: width_mm is 'nan'"),
        (SHELF.replace("800", "1" + "0" * 400), "row shelf: width_mm is '1000"),
        (SHELF.replace("800", "true"), "row shelf: width_mm is 'True'"),
        (SHELF.replace("800", '"800 mm"'), "row shelf: width_mm is '800 mm'"),
        (SHELF.replace("width_mm = 800", ""), "row shelf: size is missing"),
        (SHELF + "diameter_mm = 3", "row shelf: size is missing"),
        (SHELF.replace("tolerance_mm = [1, 2.5]", ""), "row shelf: doubt is missing"),
        (SHELF + "spread_mm = 1", "row shelf: doubt is 'tolerance_mm and spread_mm'"),
        (SHELF.replace("[1, 2.5]", "[1, 2.5, 3]"), "row shelf: tolerance_mm is '.1, 2.5, 3.'"),
        (SHELF.replace("[1, 2.5]", "0"), "row shelf: tolerance_mm is '0'"),
        (SHELF.replace("[1, 2.5]", "900"), "row shelf: tolerance_mm is 900; give less than width_mm"),
        (SHELF.replace('"tape"', '""'), "row shelf: source is ''"),
        (SHELF.replace('"our shelf"', '"our\\u001b shelf"'), "row shelf: title is 'our"),
        (SHELF + 'aliases = "rack"', "row shelf: aliases is 'rack'"),
        (SHELF + "widht_mm = 800", "row shelf: widht_mm is '800'; a row has aliases, diameter_mm"),
        ("x = " + "[" * 100_000, "is not TOML"),
        ("# " + "x" * 2**20, "is larger than 1 MiB"),
    ],
)
def test_a_broken_file_is_refused_in_one_line(own, text, says):
    with pytest.raises(FileFormatError, match=r"own\.toml: " + says) as error:
        targets(own(text))
    assert "\n" not in str(error.value)


def test_a_file_that_is_not_there_or_no_text(tmp_path):
    with pytest.raises(FileFormatError, match="no such file"):
        targets(tmp_path / "none.toml")
    path = tmp_path / "own.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(FileFormatError, match="is not TOML"):
        targets(path)


# -- the command line --------------------------------------------------------------------------------------


def test_the_command_lists_and_searches(own):
    def run(*arguments):
        return CliRunner().invoke(main, ["targets", *map(str, arguments)], catch_exceptions=False)

    everything = run().output
    assert all(name in everything for name in targets())
    found = run("card", "bank").output
    assert "id-1" in found and "85.6 ± 0.13 mm (limits)" in found and "id-3" not in found
    assert "our shelf" in run("shelf", "--file", own(SHELF)).output
    refused = run("--file", own("[shelf"))
    assert refused.exit_code == 2 and "is not TOML" in refused.output
