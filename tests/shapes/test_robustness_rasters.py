"""Rasters of terrain: what a file says of its numbers counts, or is refused where unclear."""

import os
import re
import sys
import warnings

import numpy as np
import pytest

from granular import HeightMap
from granular.shapes.rasters import largest_rectangle

pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # affine, in rasterio

HEAD = "ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 2\nNODATA_value -9999\n"
ROWS = "4 5 6\n1 2 3\n"
UTM = (512345.25, 5234567.75)
FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937


def hills(ny=12, nx=16):
    y, x = np.mgrid[:ny, :nx]
    return 300.0 + 20 * np.sin(x / 3) + 15 * np.cos(y / 2)


def tif(path, z, *, crs="EPSG:32633", mark=None, unit="", numbers=None, mask=None, **change):
    """Write a GeoTIFF with posts at distances of 10 units, the first row in the north."""
    rasterio = pytest.importorskip("rasterio")
    z = np.atleast_3d(np.asarray(z)) if np.ndim(z) == 2 else np.moveaxis(np.asarray(z), 0, -1)
    to = rasterio.Affine(10.0, 0.0, UTM[0], 0.0, -10.0, UTM[1])
    kind = {"driver": "GTiff", "height": z.shape[0], "width": z.shape[1], "count": z.shape[2]}
    kind |= {"dtype": z.dtype, "crs": crs, "nodata": mark, "transform": to} | change
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of files without a place
        with rasterio.open(path, "w", **kind) as raster:
            raster.write(np.moveaxis(z, -1, 0))
            if unit:
                raster.units = (unit,) * z.shape[2]
            if numbers:
                raster.scales, raster.offsets = (numbers[0],), (numbers[1],)
            if mask is not None:
                raster.write_mask(mask)
    return path


def asc(path, z, *, step=10.0, corner=UTM, mark=None):
    head = f"ncols {z.shape[1]}\nnrows {z.shape[0]}\nxllcorner {corner[0]}\nyllcorner {corner[1]}\n"
    head += f"cellsize {step}\n" + ("" if mark is None else f"NODATA_value {mark}\n")
    path.write_text(head + "\n".join(" ".join(map(repr, row)) for row in z.tolist()) + "\n")
    return path


# ---- text ----


@pytest.mark.parametrize(
    "text",
    [
        HEAD + ROWS,
        "\ufeff" + HEAD + ROWS,
        "\n \n" + HEAD + "\n" + ROWS,
        (HEAD + ROWS).replace("\n", "\r\n").replace(" ", "\t").upper(),
        HEAD.replace("corner 1", "center 1").replace("corner 2", "center 2") + ROWS,
        HEAD.replace("cellsize 2", "dx 2\ndy 2") + "4 5\n6 1 2\n3",
        HEAD.replace("ncols 3", "ncols 3.0") + ROWS.replace("5", "5e0"),
    ],
)
@pytest.mark.parametrize("name", ["a.asc", "a.ASC", "a.txt"])
def test_an_esri_grid_is_read(tmp_path, text, name):
    path = tmp_path / name
    path.write_bytes(text.encode())
    shape = HeightMap.read(path)
    assert shape.z.tolist() == [[1, 2, 3], [4, 5, 6]]
    half = 0.0 if "center" in text else 1.0
    assert shape.spacing == (2.0, 2.0) and shape.origin == (10.0 + half, 20.0 + half)
    moved = HeightMap.read(path, origin=(0.0, 0.0), scale=0.1)
    assert moved.origin == (0.0, 0.0) and moved.upper == pytest.approx((0.4, 0.2))
    assert moved.z[1, 2] == pytest.approx(0.6)
    assert HeightMap.read(path, scale=(1.0, 0.1)).spacing == (2.0, 2.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("nothing here\n", "line 1: 'nothing here' must be one of ncols"),
        (HEAD + "4 -9999 6\n1 2 3\n", "1 of 6 posts have no height, at x = 13 to 13, y = 23 to 23"),
        (HEAD + "4 5 6\n1 2\n", "must hold 6 heights by its header, has 5"),
        (HEAD + ROWS + "7", "must hold 6 heights by its header, has more"),
        (HEAD + "4 5 6\n1 x 3\n", "line 8: 'x' must be a number"),
        (HEAD + "4 5 6\n1 -1e400 inf\n", "line 8: '-1e400' must be from -1.8e308 to 1.8e308"),
        (HEAD + "4 inf 6\n1 2 3\n", "1 of 6 posts have no height"),
        (HEAD + "4 5 6\n1 2,5 3\n", "line 8: '2,5' must be a number: write decimals with a point"),
        (HEAD.replace("10", "10,5") + ROWS, "line 3: 'xllcorner 10,5' must have a number, with a"),
        (HEAD.replace("cols 3", "cols inf") + ROWS, "ncols = inf must be a whole number"),
        (HEAD.replace("cols 3", "cols 20.7") + ROWS, "ncols = 20.7 must be a whole number"),
        (HEAD.replace("rows 2", "rows -2") + ROWS, "nrows = -2 must be a whole number"),
        (HEAD.replace("rows 2", "rows 1e300") + ROWS, "nrows = 1e.300 must be a whole number"),
        (HEAD.replace("3\nnrows 2", "60000\nnrows 60000") + ROWS, "must be at most 2147483647"),
        (HEAD.replace("rows 2", "rows nan") + ROWS, "nrows = nan must be a whole number"),
        (HEAD.replace("size 2", "size inf") + ROWS, "must have finite sizes > 0"),
        (HEAD.replace("size 2", "size -2") + ROWS, "must have finite sizes > 0"),
        (HEAD.replace("size 2", "size 2\ndx 1\ndy 1") + ROWS, "once"),
        (HEAD.replace("10", "nan") + ROWS, "must be finite"),
        (HEAD.replace("yllcorner", "yllcenter") + ROWS, "must begin with ncols"),
        (HEAD.replace("ncols 3", "ncols 3\nncols 4") + ROWS, "line 2: 'ncols 4' must not be given"),
        (HEAD.replace("ncols 3", "ncols three") + ROWS, "line 1: 'ncols three' must have a number"),
        (HEAD.replace("ncols 3", "ncols 3\ncompression 4") + ROWS, "line 2: 'compression 4' must"),
        (HEAD.replace("s 2", "s 3") + "4 5 6\n1 nan 3\n4 5 6", "y = 23 to 23, 1 of them in holes"),
        (HEAD + "nan nan nan\n" * 2, "none of its 6 posts has a height"),
    ],
)
def test_faults_of_a_text_are_named(tmp_path, text, message):
    path = tmp_path / "a.asc"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        HeightMap.read(path)
    assert str(path) in str(caught.value)


def test_what_is_no_text_is_named(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(HEAD + ROWS, encoding="utf-16")
    with pytest.raises(ValueError, match="UTF-16"):
        HeightMap.read(path)
    path.write_bytes(HEAD.encode() + b"\0\xff" * 99)
    with pytest.raises(ValueError, match="must be a number"):
        HeightMap.read(path)
    os.mkfifo(tmp_path / "pipe.asc")
    with pytest.raises(ValueError, match="is a pipe"):
        HeightMap.read(tmp_path / "pipe.asc")
    with pytest.raises(FileNotFoundError):
        HeightMap.read(tmp_path / "none.asc")
    with pytest.raises(ValueError, match=r"band = 2 must be 1"):
        HeightMap.read(asc(path, hills()), band=2)


def test_without_rasterio_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rasterio", None)
    (tmp_path / "a.tif").write_bytes(b"II*\0")
    with pytest.raises(ModuleNotFoundError, match=r"pip install granular-flow\[terrain\]"):
        HeightMap.read(tmp_path / "a.tif")


# ---- units ----


def test_a_geotiff_keeps_its_places_and_type(tmp_path):
    z = hills().astype(np.float32)
    shape = HeightMap.read(tif(tmp_path / "a.tif", z))
    assert shape.z.dtype == np.float32 and np.array_equal(shape.z, z[::-1])
    assert shape.spacing == (10.0, 10.0) and shape.origin == (UTM[0] + 5, UTM[1] - 115)
    import rasterio

    for to, order in (
        (rasterio.Affine(10, 0, UTM[0], 0, 10, UTM[1] - 120), (slice(None), slice(None))),
        (rasterio.Affine(-10, 0, UTM[0] + 160, 0, -10, UTM[1]), np.s_[::-1, ::-1]),
    ):
        other = HeightMap.read(tif(tmp_path / "b.tif", z, transform=to))
        assert np.array_equal(other.z, z[order]) and other.origin == shape.origin


@pytest.mark.parametrize(
    ("crs", "unit", "along", "up"),
    [
        ("EPSG:32633", "m", 1, 1),
        ("EPSG:32633", "US survey foot", 1, SURVEY_FOOT),
        ("EPSG:32633", "cm", 1, 0.01),
        ("EPSG:2263", "foot", SURVEY_FOOT, FOOT),
        ("EPSG:2263", "metre", SURVEY_FOOT, 1),
        ("EPSG:2263+6360", "", SURVEY_FOOT, SURVEY_FOOT),
        ("EPSG:32633+5773", "", 1, 1),
        (None, "ft", 1, FOOT),
    ],
)
def test_units_become_metres(tmp_path, crs, unit, along, up):
    z = hills()
    shape = HeightMap.read(tif(tmp_path / "a.tif", z, crs=crs, unit=unit))
    np.testing.assert_allclose(shape.z, up * z[::-1], rtol=1e-14)
    np.testing.assert_allclose(shape.spacing, along * 10, rtol=1e-14)
    np.testing.assert_allclose(shape.origin, along * np.array([UTM[0] + 5, UTM[1] - 115]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"crs": "EPSG:2263"}, r"give scale = 0.3048006096 if .* or scale = \(0.3048006096, 1.0\)"),
        ({"crs": "EPSG:3857"}, "its lengths depend on the latitude"),
        ({"unit": "hPa"}, "the unit 'hPa' of its band 1 is no length"),
    ],
)
def test_unclear_units_need_a_scale(tmp_path, options, message):
    path = tif(tmp_path / "a.tif", hills(), **options)
    with pytest.raises(ValueError, match=message):
        HeightMap.read(path)
    assert HeightMap.read(path, scale=(2.0, 1.0)).spacing == (20.0, 20.0)


def test_degrees_and_depths_are_refused(tmp_path):
    import rasterio

    to = rasterio.Affine(1 / 3600, 0, 8.5, 0, -1 / 3600, 46.5)
    path = tif(tmp_path / "a.tif", hills(), crs="EPSG:4326", transform=to)
    for scale in (None, 1e5):
        with pytest.raises(ValueError, match=r"are degrees .* gdalwarp -t_srs EPSG:32632"):
            HeightMap.read(path, scale=scale)
    with pytest.raises(ValueError, match="depths"):
        HeightMap.read(tif(path, hills(), crs="EPSG:32633+5715"))
    # a text says nothing of its units; a file beside it may
    path = asc(tmp_path / "b.asc", hills(), step=1 / 1200, corner=(8.5, 46.5))
    with pytest.raises(ValueError, match="its coordinates are perhaps degrees or kilometres"):
        HeightMap.read(path)
    assert HeightMap.read(path, scale=(1e5, 1.0)).spacing[0] == pytest.approx(1e5 / 1200)
    text = rasterio.CRS.from_epsg(4326).to_wkt(version="WKT1_ESRI")
    for given, message in (
        (text, "are degrees .* by b.prj"),
        ("Projection GEOGRAPHIC\nUnits DD\n", "are degrees"),
        ("?", "not understood"),
    ):
        path.with_suffix(".prj").write_text(given)
        with pytest.raises(ValueError, match=message):
            HeightMap.read(path)
    path.with_suffix(".prj").unlink()
    path = asc(path, hills())
    for name in ("B.PRJ", "b.prj"):  # the second counts before the first
        path.with_name(name).write_text("Projection UTM\nZunits FEET\nUnits METERS\nZone 33\n")
        np.testing.assert_allclose(HeightMap.read(path).z, FOOT * hills()[::-1])
        path.with_name("B.PRJ").write_text("?")


def test_scale_and_offset_are_applied(tmp_path):
    z = np.round(hills() * 10).astype(np.int16)
    z[0, :3] = -7
    shape = HeightMap.read(
        tif(tmp_path / "a.tif", z, numbers=(0.1, 100.0), mark=-7, unit="ft"), fill=1.0
    )
    wanted = (z * 0.1 + 100) * FOOT
    wanted[0, :3] = 1.0
    np.testing.assert_allclose(shape.z, wanted[::-1], rtol=1e-14)


def test_other_faults_of_a_raster(tmp_path):
    import rasterio

    path, z = tmp_path / "a.tif", hills()
    for change, message in (
        ({"transform": rasterio.Affine(1, 0.5, 0, 0, -1, 0)}, "must not be turned"),
        ({"transform": rasterio.Affine.identity(), "crs": None}, "must say where its posts are"),
        ({"numbers": (0.0, 1.0)}, "the scale not 0"),
    ):
        with pytest.raises(ValueError, match=message):
            HeightMap.read(tif(path, z, **change))
    two = tif(path, np.stack([z, z + 1]))
    with pytest.raises(ValueError, match="has 2 bands"):
        HeightMap.read(two)
    assert HeightMap.read(two, band=2).z[0, 0] == z[-1, 0] + 1
    with pytest.raises(ValueError, match="band = 3 must be one of"):
        HeightMap.read(two, band=3)
    picture = tif(path, np.zeros((3, 9, 9), dtype=np.uint8), photometric="RGB")
    with pytest.raises(ValueError, match="must hold heights, has red uint8"):
        HeightMap.read(picture, band=1)
    path.write_bytes(path.read_bytes()[:150])
    for content in (path.read_bytes(), b"text", b""):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=re.escape(str(path))):
            HeightMap.read(path)
    with pytest.raises(ValueError, match="must be a raster"):
        HeightMap.read(tmp_path)


# ---- gaps ----


@pytest.mark.parametrize("mark", [-9999, -32768, -3.4028235e38, 1e20, -99999, np.nan, 0, -999])
@pytest.mark.parametrize("kind", ["tif", "asc"])
def test_gaps_are_seen_whether_declared_or_not(tmp_path, mark, kind):
    """Declared: gaps. Not declared: a mark is named, and `nodata` makes gaps of it."""
    z = hills().astype(np.float32)
    z[:2, 3:9] = mark
    write = (lambda **o: tif(tmp_path / "a.tif", z, **o)) if kind == "tif" else None
    write = write or (lambda **o: asc(tmp_path / "a.asc", z.astype(float), **o))
    with pytest.raises(ValueError, match="12 of 192 posts have no height"):
        HeightMap.read(write(mark=mark))
    path = write()
    if mark == 0:  # might be the sea
        with pytest.warns(UserWarning, match=r"12 posts have the value 0.0, .* give nodata=0.0"):
            HeightMap.read(path)
    else:
        wanted = "no height" if np.isnan(mark) else "12 posts have the .*nodata="
        with pytest.raises(ValueError, match=wanted):
            HeightMap.read(path)
    with pytest.raises(ValueError, match="12 of 192 posts have no height"):
        HeightMap.read(path, nodata=mark)
    filled = HeightMap.read(path, nodata=mark, fill="nearest").z
    assert filled.shape == z.shape and (filled > 200).all()
    if -1e4 <= mark <= 9e3:
        assert HeightMap.read(path, nodata=float("nan"), scale=1.0).z.min() == mark


def test_a_pit_and_blocks_on_a_floor_are_no_marks(tmp_path):
    z = np.zeros((20, 20))
    z[5, 5] = -9.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        HeightMap.read(asc(tmp_path / "a.asc", z, step=0.5))
        z[8:12, 8:12] = 0.4
        HeightMap.read(asc(tmp_path / "a.asc", z, step=0.05, corner=(0.0, 0.0)))


@pytest.mark.parametrize("kind", ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32"])
def test_heights_of_all_types_are_no_marks(tmp_path, kind):
    """Differences of whole numbers do not wrap around; the highest posts are two."""
    low = -120 if kind == "int8" else 0
    z = (low + (hills() - hills().min()) * 3).astype(kind)
    z[5, 5:7], z[7, 7:9] = z.max() + 1, z.min()
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        assert np.array_equal(HeightMap.read(tif(tmp_path / "a.tif", z)).z, z[::-1])
    z = (120 + hills() % 5).astype("uint8")
    z[:2, 3:9] = 255 if kind == "uint8" else 0
    with pytest.warns(UserWarning, match=rf"12 posts have the value {z[0, 3]}, which is 1\d\d m"):
        HeightMap.read(tif(tmp_path / "a.tif", z))


def test_steps_to_floors_roofs_and_crests_are_no_marks(tmp_path):
    y, x = np.mgrid[:30, :40]
    ramp, ground = 2.0 - 0.05 * x, 120.0 + 0.3 * np.sin(x / 3) + 0.2 * np.cos(y / 2)
    steps = {
        "floor": (np.where(x > 25, 0.0, ramp), 0.01),
        "table": (np.where(x > 25, 0.0, 1.0), 0.01),
        "roof": (np.where((abs(x - 20) < 6) & (abs(y - 15) < 5), 140.0, ground), 0.5),
        "crest": (np.where(abs(x - 20) < 2, 220.0, ground), 1.0),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        for name, (z, step) in steps.items():
            HeightMap.read(asc(tmp_path / f"{name}.asc", z, step=step))


@pytest.mark.parametrize("kind", ["tif", "asc"])
def test_gaps_at_the_rim_are_cut_off_or_filled(tmp_path, kind):
    """The window that the error offers can be given as it is, also far from the origin."""
    z = hills(40, 60)
    y, x = np.mgrid[:40, :60]
    z[(x - 30) ** 2 + (1.4 * (y - 20)) ** 2 > 27**2] = -9999
    path = (tif if kind == "tif" else asc)(tmp_path / f"a.{kind}", z, mark=-9999)
    with pytest.raises(ValueError, match="all of them joined to its rim") as caught:
        HeightMap.read(path)
    window = eval(re.search(r"window=(\(.*?\))", str(caught.value))[1])
    part = HeightMap.read(path, window=window)
    assert part.origin == window[:2] and part.upper == pytest.approx(window[2:], rel=1e-15)
    assert part.z.size > 0.5 * (z > 0).sum() and part.z.min() > 200
    whole = HeightMap.read(path, fill="nearest")
    i, j = (round((a - b) / 10) for a, b in zip(part.origin, whole.origin, strict=True))
    assert np.array_equal(whole.z[j:, i:][: part.z.shape[0], : part.z.shape[1]], part.z)
    assert HeightMap.read(path, fill=7.5).z.min() == 7.5
    with pytest.raises(ValueError, match="posts have no height"):
        HeightMap.read(path, window=(window[0], window[1] - 10, *window[2:]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"window": (0, 0, 1, 1)}, r"lie along x, from 0 to 1, within .* for x = 10 to 16"),
        ({"window": (10, 20, 16, 25)}, r"lie along y, from 20 to 25, within .* for y = 20 to 24"),
        ({"window": (14, 20, 10, 24)}, "from a lower to a higher position"),
        ({"window": (10.5, 20, 12.9, 24)}, "must hold two posts at least along x"),
        ({"window": (10, 20, 16)}, "window = .* must be 4 numbers"),
        ({"window": (10, 20, float("nan"), 24)}, r"window\[2\] = nan"),
        ({"fill": "linear"}, "fill = 'linear' must be one of 'nearest'"),
        ({"fill": float("inf")}, "fill = inf"),
        ({"nodata": "x"}, "nodata = 'x'"),
        ({"scale": 0.0}, "scale = 0.0"),
        ({"scale": (1.0, -1.0)}, r"scale\[1\] = -1.0"),
        ({"band": 0}, "band = 0"),
    ],
)
def test_bad_arguments_are_refused(tmp_path, change, message):
    path = tmp_path / "a.asc"
    path.write_text(HEAD + ROWS)
    with pytest.raises((TypeError, ValueError), match=message):
        HeightMap.read(path, **change)


def test_the_largest_rectangle():
    """Against all rectangles, on random maps; in blocks on a large one."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        there = rng.random((6, 7)) < 0.8
        spans = [
            (np.s_[a:b, c:d], (b - a) * (d - c))
            for a in range(6) for b in range(a + 1, 7) for c in range(7) for d in range(c + 1, 8)
        ]  # fmt: skip
        most = max((size for part, size in spans if there[part].all()), default=0)
        part = largest_rectangle(there)
        assert there[part].all() and there[part].size == most
    there = np.ones((1500, 2000), dtype=bool)
    there[700:, :300] = False
    part = largest_rectangle(there)
    assert there[part].all() and there[part].size > 0.99 * 1700 * 1500
