import dataclasses
import json
import re

import numpy as np
import pytest
from report_sample import (
    RULES,
    made_up_choices,
    made_up_results,
    made_up_strip,
    made_up_timeline,
)

from agents.report.answer import details, verdict
from agents.report.charts import prices_apart, undominated
from agents.report.page import REPORT, render_page, write_report
from agents.report.results import (
    CHOICES,
    FRAMES,
    RESULTS,
    TIMELINE,
    label,
    read_strip,
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
    return render_page(made_up_results(), made_up_timeline(), made_up_choices(), made_up_strip())


def text_of_table(page, body):
    return re.search(rf'<tbody class="{body}">.*?</tbody>', page, flags=re.DOTALL).group()


def named_in(page, body):
    return re.findall(r"<tr[^>]*>\s*<td>([^<]*)", text_of_table(page, body))


def write_sample(folder):
    write_json(folder / RESULTS, made_up_results())
    write_json(folder / TIMELINE, made_up_timeline())
    write_json(folder / CHOICES, made_up_choices())
    write_strip(folder / FRAMES, made_up_strip())


@pytest.mark.parametrize(
    ("better", "begins", "holds"),
    [
        # A quarter of `better` is saved, give or take 5 %.
        (0.8, "At the depth error of always 8 DCS (0.32 m) the scheduler saves 20 %", "15 to 25 %"),
        (0.8, "At", "its laser lives 1.8 times as long (1.7 to 1.9) and is 4.0 K cooler"),
        (0.0, "No significant difference: at the depth error of always 8 DCS", "saves 0 %"),
        (0.2, "No significant difference", "0 to 10 %"),
    ],
)
def test_verdict_says_what_the_interval_says(better, begins, holds):
    sentence = verdict(made_up_results(better=better))
    assert sentence.startswith(begins) and holds in sentence
    assert sentence.count(". ") == 0 and sentence.endswith(" over 24 test drives.") == (
        begins.startswith("No")
    )


@pytest.mark.parametrize(
    ("better", "says"),
    [
        (
            0.9,
            "Against the best of the tuned rules, look and hold, at half the energy its error is "
            "0.20 m less (95 % interval 0.15 to 0.25)",
        ),
        (0.3, "0.10 m more (95 % interval 0.05 to 0.15)"),
        (0.54, "No significant difference to the best of the tuned rules, look and hold"),
    ],
)
def test_the_best_rule_is_named_with_its_interval(better, says):
    assert says in " ".join(details(made_up_results(better=better)))


def test_a_scheduler_of_one_price_is_said_to_have_no_knob():
    one, range_of = (
        " ".join(details(made_up_results(prices=prices))) for prices in ((0.09,), (0.01, 0.1))
    )
    assert "trained at one price, 0.09, and has no knob" in one and "no knob" not in range_of


def test_without_rules_and_optimum_the_rest_is_told():
    results = made_up_results()
    for name in (*RULES, "optimum"):
        del results["answer"]["measures"][name]
        del results["fronts"][name]
    for one in results["answer"]["measures"].values():
        del one["gap_closed"]
    told = " ".join(details(results))
    assert "rules" not in told and "gap" not in told and "At half the laser energy" in told
    assert "Optimum" not in text_of_table(
        render_page(results, made_up_timeline(), made_up_choices(), made_up_strip()), "fronts"
    )


def test_more_than_the_whole_gap_is_explained():
    def told(closed):
        results = made_up_results()
        results["answer"]["measures"]["look_and_hold"]["gap_closed"]["mean"] = closed
        page = render_page(results, made_up_timeline(), made_up_choices(), made_up_strip())
        return "More than 100 % of a gap" in page

    assert told(1.5) and not told(1.0)


def test_prices_that_would_cover_each_other_are_left_out():
    rows = [
        {"price": price, "laser_energy_share": share}
        for price, share in ((0.3, 0.3), (0.2, 0.31), (0.1, 0.5), (0.05, 0.52), (0.01, 0.6))
    ]
    assert prices_apart(rows) == ["0.3", "", "0.1", "", "0.01"]


def test_a_front_is_drawn_along_points_that_no_other_beats():
    errors = [1.0, 1.2, 0.5, 0.5, 0.4]
    rows = [{"depth_mae_m": error} for error in errors]
    assert [row["depth_mae_m"] for row in undominated(rows)] == [1.0, 0.5, 0.4]


def test_page_is_self_contained(page):
    without_plotly = re.sub(r"<script>.*?</script>", "", page, count=1, flags=re.DOTALL)
    assert not re.search(r"(src|href)\s*=\s*[\"'](https?:)?//", without_plotly)
    # The first script is plotly itself, the others the charts and the page's own.
    library, *calls = re.findall(r"<script[^>]*>(.*?)</script>", page, flags=re.DOTALL)
    assert len(library) > 10**6 and "plotly.js" in library[:200]
    assert sum("Plotly.newPlot" in call for call in calls) == 5


def test_page_shows_every_policy_and_family(page):
    policies = sorted(label(name) for name in made_up_results()["policies"])
    assert sorted(named_in(page, "policies")) == sorted(named_in(page, "tails")) == policies
    expected = ["Scheduler", "Look and hold", "SNR threshold rule"]
    expected += ["Best mixture of fixed choices", "Optimum, knows all"]
    assert named_in(page, "fronts") == expected
    assert named_in(page, "knob") == ["0.01", "0.1"]
    for family in FAMILIES:
        assert f'data-family="{family}"' in page
    plain = page.replace("\u00a0", " ")
    for sentence in (verdict(made_up_results()), *details(made_up_results())):
        assert sentence in plain


def test_a_policy_whose_temporal_error_is_not_known_has_a_dash():
    results = made_up_results()
    results["policies"]["always_4"]["temporal_error_m"] = None
    del results["policies"]["always_8"]["temporal_error_m"]
    page = render_page(results, made_up_timeline(), made_up_choices(), made_up_strip())
    shown = text_of_table(page, "tails")
    dashed = [row for row in shown.split("</tr>") if "<td>\u2013</td>" in row]
    assert len(dashed) == 2 and all(re.search("Always [48] DCS", row) for row in dashed)


def test_page_holds_five_pictures_of_each_frame(page):
    frames = json.loads(re.search(r"const frames = (\[.*?\]);\n", page).group(1))
    strip = made_up_strip()
    assert len(frames) == len(strip.frame)
    assert {frame["family"] for frame in frames} == set(FAMILIES)
    for frame in frames:
        assert set(frame["images"]) == {"gray", "wrapped", "corrected", "truth", "error"}
        assert decoded(frame["images"]["truth"]).shape == (24, 32, 3)


def rows_of_drive(page):
    return json.loads(re.search(r"const drive = .*?, rows: (\[.*?\]) };\n", page).group(1))


def test_the_drive_tells_every_policy_frame_by_frame(page):
    record, rows = made_up_timeline(), rows_of_drive(page)
    assert [row["label"] for row in rows] == ["Scheduler", "Optimum", "Always 8 DCS"]
    played = record["policies"]["always_8"]
    assert rows[2]["shots"] == played["shots"] and rows[2]["mae"][200] is None
    assert rows[2]["energy"][-1] == pytest.approx(0.002 * 8 * 236)  # 20 frames without laser
    temperature_k = np.array(played["temperature_k"])
    np.testing.assert_allclose(rows[2]["margin"], record["trip_k"] - temperature_k, atol=0.01)
    np.testing.assert_allclose(rows[2]["celsius"], temperature_k - 273.15, atol=0.01)


def test_frames_tell_heat_energy_and_the_optimum(page):
    frames = json.loads(re.search(r"const frames = (\[.*?\]);\n", page).group(1))
    assert frames[0]["energy"] == 0.5 and frames[-1]["energy"] == 1.5
    assert frames[0]["margin"] == pytest.approx(10.0) and frames[0]["best"]["shots"] == 4
    assert frames[-1]["best"]["energy"] == 0.75


def test_an_optimum_that_is_not_known_is_said_to_be_missing():
    record, strip = made_up_timeline(), made_up_strip()
    del record["policies"]["optimum"]
    nothing = np.empty(0)
    strip = dataclasses.replace(strip, optimum_shots=nothing, optimum_energy_j=nothing)
    page = render_page(made_up_results(), record, made_up_choices(), strip)
    assert "What the optimum would have done is not known" in page
    assert [row["label"] for row in rows_of_drive(page)] == ["Scheduler", "Always 8 DCS"]
    frames = json.loads(re.search(r"const frames = (\[.*?\]);\n", page).group(1))
    assert {frame["best"] for frame in frames} == {None}


def test_texts_follow_the_configuration():
    page = render_page(made_up_results(), made_up_timeline(), made_up_choices(), made_up_strip())
    other = made_up_results(f1_hz=10e6, split="shift")
    changed = render_page(other, made_up_timeline(), made_up_choices(), made_up_strip())
    assert "<figcaption>Wrapped map, 24 MHz</figcaption>" in page
    assert "<figcaption>Wrapped map, 10 MHz</figcaption>" in changed and "24 MHz" not in changed
    assert "over 24 test drives" in page and "the same 24 drives of the test split" in page
    assert "over 24 shift drives" in changed and "the same 24 drives of the shift split" in changed


def test_names_are_escaped():
    results = made_up_results()
    results["policies"]["<script>x"] = results["policies"]["random"]
    results["paired_to_best_fixed"]["<script>x"] = results["paired_to_best_fixed"]["random"]
    table = render_page(results, made_up_timeline(), made_up_choices(), made_up_strip())
    assert "<rule>" not in table
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


@pytest.mark.parametrize("name", [RESULTS, TIMELINE, CHOICES, FRAMES])
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
    write_json(tmp_path / CHOICES, made_up_choices())
    page = write_report(tmp_path).read_text()
    assert "Bank pocket holds every 8th pixel and no images" in page
    assert 'id="frames"' not in page and "const frames" not in page
