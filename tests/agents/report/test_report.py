import json
import re

import numpy as np
import pytest
from report_sample import made_up_results, made_up_strip, made_up_timeline

from agents.report.page import REPORT, render_page, write_report
from agents.report.results import (
    FRAMES,
    RESULTS,
    TIMELINE,
    label,
    read_strip,
    rival_note,
    verdict,
    write_strip,
)
from shotenv.config.families import FAMILIES
from unwrap.pictures.colors import VIRIDIS, ColorMap, picture
from unwrap.support.files import write_bytes, write_json


def decoded(uri):
    import base64
    import io

    from PIL import Image

    head, content = uri.split(",", 1)
    assert head == "data:image/png;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(content))).convert("RGB"))


@pytest.fixture(scope="module")
def page():
    return render_page(made_up_results(), made_up_timeline(), made_up_strip())


def write_sample(folder):
    write_json(folder / RESULTS, made_up_results())
    write_json(folder / TIMELINE, made_up_timeline())
    write_strip(folder / FRAMES, made_up_strip())


@pytest.mark.parametrize(
    ("difference", "says"),
    [
        ((6.0, 2.0, 9.0), "beats the best fixed choice, always 4 DCS, by 6.0"),
        ((-6.0, -9.0, -2.0), "does worse than the best fixed choice, always 4 DCS, by 6.0"),
        ((1.0, -2.0, 3.0), "No significant difference"),
        ((1.0, 0.0, 3.0), "includes zero"),
    ],
)
def test_verdict_says_what_the_interval_says(difference, says):
    sentence = verdict(made_up_results(difference))
    assert says in sentence and sentence.count(". ") == 0 and sentence.endswith(".")


def test_strongest_rival_is_named_with_its_interval():
    results = made_up_results()
    assert "cycle, its return is +0.4" in rival_note(results)
    assert "-0.2 to +1.1, which includes zero" in rival_note(results)
    results["paired_to_best_rival"] = {"difference": 0.4, "low": 0.1, "high": 1.1}
    assert "zero" not in rival_note(results)


def test_page_is_self_contained(page):
    without_plotly = re.sub(r"<script>.*?</script>", "", page, count=1, flags=re.DOTALL)
    assert not re.search(r"(src|href)\s*=\s*[\"'](https?:)?//", without_plotly)
    # The first script is plotly itself, the others the charts and the page's own.
    library, *calls = re.findall(r"<script[^>]*>(.*?)</script>", page, flags=re.DOTALL)
    assert len(library) > 10**6 and "plotly.js" in library[:200]
    assert sum("Plotly.newPlot" in call for call in calls) == 3


def test_page_shows_every_policy_and_family(page):
    table = re.search(r"<tbody>.*?</tbody>", page, flags=re.DOTALL).group()
    named = re.findall(r"<tr[^>]*>\s*<td>([^<]*)", table)
    assert sorted(named) == sorted(label(name) for name in made_up_results()["policies"])
    for family in FAMILIES:
        assert f'data-family="{family}"' in page
    assert verdict(made_up_results()) in page and rival_note(made_up_results()) in page


def test_page_holds_five_pictures_of_each_frame(page):
    frames = json.loads(re.search(r"const frames = (\[.*?\]);\n", page).group(1))
    strip = made_up_strip()
    assert len(frames) == len(strip.frame)
    assert {frame["family"] for frame in frames} == set(FAMILIES)
    for frame in frames:
        assert set(frame["images"]) == {"gray", "wrapped", "corrected", "truth", "error"}
        assert decoded(frame["images"]["truth"]).shape == (24, 32, 3)


def test_texts_follow_the_configuration():
    page = render_page(made_up_results(), made_up_timeline(), made_up_strip())
    other = made_up_results(f1_hz=10e6, split="shift")
    changed = render_page(other, made_up_timeline(), made_up_strip())
    assert "<figcaption>Wrapped map, 24 MHz</figcaption>" in page
    assert "<figcaption>Wrapped map, 10 MHz</figcaption>" in changed and "24 MHz" not in changed
    assert "over 24 test drives" in page and "the same 24 drives of the test split" in page
    assert "over 24 shift drives" in changed and "the same 24 drives of the shift split" in changed


def test_names_are_escaped():
    results = made_up_results()
    results["policies"]["<script>x"] = results["policies"]["random"]
    results["paired_to_best_fixed"]["<script>x"] = results["paired_to_best_fixed"]["random"]
    table = render_page(results, made_up_timeline(), made_up_strip())
    assert "<td><script>x" not in table and "&lt;script&gt;x" in table


def test_picture_maps_low_to_high_and_nothing_to_gray():
    colors = ColorMap(0.0, 10.0, "m", VIRIDIS)
    rgb = decoded(picture(np.array([[0.0, 10.0], [99.0, np.nan]]), colors))
    assert rgb[0, 0].tolist() == [0x44, 0x01, 0x54]
    assert rgb[0, 1].tolist() == rgb[1, 0].tolist() == [0xFD, 0xE7, 0x25]
    assert rgb[1, 1].tolist() == [214, 217, 222]


def test_strip_survives_the_disk(tmp_path):
    strip = made_up_strip()
    write_strip(tmp_path / FRAMES, strip)
    for name, value in vars(read_strip(tmp_path / FRAMES)).items():
        np.testing.assert_array_equal(value, getattr(strip, name))


@pytest.mark.parametrize("name", [RESULTS, TIMELINE, FRAMES])
@pytest.mark.parametrize("damage", ["missing", "cut off", "other"])
def test_damaged_results_are_named_and_the_old_page_stays(tmp_path, name, damage):
    write_sample(tmp_path)
    page, path = tmp_path / REPORT, tmp_path / name
    page.write_text("old")
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:100] if damage == "cut off" else b"{}")
    with pytest.raises(ValueError, match=f"{name}|cannot show"):
        write_report(tmp_path)
    assert page.read_text() == "old"


def test_a_full_disk_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "numbers.json"
    path.write_text("old")

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_bytes(path, b"new")
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_the_page_of_a_thinned_bank_says_why_it_shows_no_frames(tmp_path):
    results = made_up_results() | {"every": 8}
    results["config"]["env"]["bank"] = "pocket"
    write_json(tmp_path / RESULTS, results)
    write_json(tmp_path / TIMELINE, made_up_timeline())
    page = write_report(tmp_path).read_text()
    assert "Bank pocket holds every 8th pixel and no images" in page
    assert 'id="frames"' not in page and "const frames" not in page
