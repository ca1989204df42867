import html.parser
import re

import pytest
from report_sample import made_up_results

from agents.report.answer import verdict
from agents.report.comparison import (
    differing,
    drives_told,
    fronts_of_all,
    measures_told,
    render_comparison,
    settings_of,
    write_comparison,
)
from agents.report.results import RESULTS
from unwrap.support.files import write_json


@pytest.fixture
def folders(tmp_path):
    """Two evaluations of the same name, of two sensors."""
    made = [tmp_path / "first" / "evaluation", tmp_path / "second" / "evaluation"]
    for folder, f1_hz, better in zip(made, (24e6, 10e6), (0.8, 0.4), strict=True):
        write_json(folder / RESULTS, made_up_results(f1_hz=f1_hz, better=better))
    return made


class Reader(html.parser.HTMLParser):
    """Tags that are open, and what the tables say."""

    VOID = ("meta", "br", "img", "input", "link")

    def __init__(self):
        super().__init__()
        self.open, self.texts = [], []

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)
        assert not any(value and "://" in value for _, value in attrs), f"{tag} links to {attrs}"

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        if not set(self.open) & {"script", "style"}:
            self.texts.append(text)


def read(page):
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return " ".join(" ".join(reader.texts).replace("\u00a0", " ").split())


def test_a_comparison_names_every_evaluation_its_answer_and_what_differs(folders, tmp_path):
    out = tmp_path / "pages" / "comparison.html"
    assert write_comparison(folders, out) == out
    text = read(out.read_text(encoding="utf-8"))
    assert "2 evaluations: first/evaluation, second/evaluation" in text
    for better in (0.8, 0.4):
        assert verdict(made_up_results(better=better)) in text
    assert "env.sensor.f1_hz 24000000.0 10000000.0" in text and "env.bank" not in text
    assert "Energy saved, same error 20 % 15 % to 25 % 10 % 5 % to 15 %" in text
    assert "Error at half the energy, m 0.60 0.50 to 0.70 0.80 0.70 to 0.90" in text
    assert "with its 95 % interval over clips" in text
    before = out.read_text(encoding="utf-8")
    assert write_comparison(folders[::-1], out) == out, "a comparison may be written anew"
    assert out.read_text(encoding="utf-8") != before


def test_the_same_configuration_is_said_to_be_the_same():
    page = render_comparison({"one": made_up_results(), "other": made_up_results(better=0.1)})
    assert "Nothing: all were run with the same configuration." in read(page)


def test_drives_that_are_not_the_same_are_named():
    here, there, shift = made_up_results(), made_up_results(), made_up_results(split="shift")
    there["config"]["env"]["bank"] = "starter"
    there["seeds"] = [7, 8]
    assert "on the same test drives of bank pocket" in drives_told([here, made_up_results()])
    assert "on different drives: bank, seeds differ" in drives_told([here, there])
    assert "on different drives: bank, split, seeds differ" in drives_told([here, there, shift])


def test_settings_are_told_by_their_names():
    one, other = made_up_results(), made_up_results()
    other["algorithm"], other["versions"]["torch"] = "dqn", "2.14.0"
    other["config"]["env"]["reward"]["power"] = [0.01, 0.2]
    assert differing([settings_of(one), settings_of(other)]) == {
        "env.reward.power": ["[0.09, 0.09]", "[0.01, 0.2]"],
        "learnt by": ["ppo", "dqn"],
        "version of torch": ["2.13.0", "2.14.0"],
    }


def test_an_unknown_optimum_leaves_its_cell_empty():
    known, unknown = made_up_results(), made_up_results()
    del unknown["answer"]["measures"]["scheduler"]["gap_closed"]
    rows = {row["title"]: row["cells"] for row in measures_told([known, unknown])}
    assert rows["Gap closed to the optimum"][1] == ("none", "")
    assert rows["Gap closed to the optimum"][0] == ("70 %", "60 % to 80 %")


def test_energies_are_shares_of_each_evaluations_own_always_8():
    other = made_up_results()
    other["answer"]["always_8"]["laser_energy_share"] = 0.5
    figure = fronts_of_all({"one": made_up_results(), "other": other})
    shown = {trace.name: trace.x for trace in figure.data if trace.mode == "markers"}
    assert shown["one: scheduler"] == pytest.approx([0.8 / 0.95, 0.9 / 0.95])
    assert shown["other: scheduler"] == pytest.approx([1.6, 1.8])
    assert set(shown) == {
        f"{name}: {words}"
        for name in ("one", "other")
        for words in ("scheduler", "fixed choices, mixed")
    }


def test_names_are_escaped():
    page = render_comparison({"<b>": made_up_results(), "other": made_up_results()})
    # But for plotly and its data, which are no markup.
    assert "<b>" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def test_what_cannot_be_compared_is_refused(folders, tmp_path):
    out = tmp_path / "comparison.html"
    with pytest.raises(ValueError, match=r"evaluation twice; expected each evaluation once"):
        write_comparison([folders[0], folders[1], folders[0] / ".." / "evaluation"], out)
    with pytest.raises(ValueError, match=r"nowhere/results.json is missing or damaged"):
        write_comparison([folders[0], tmp_path / "nowhere"], out)
    (folders[1] / RESULTS).write_text('{"answer": {}}')
    with pytest.raises(ValueError, match="second/evaluation holds results that this version"):
        write_comparison(folders, out)
    (folders[1] / RESULTS).write_text("{")
    with pytest.raises(ValueError, match=r"second/evaluation/results.json is missing or damaged"):
        write_comparison(folders, out)
    assert not out.exists()


def test_nothing_but_a_comparison_is_overwritten(folders, tmp_path):
    page = tmp_path / "thesis.html"
    page.write_bytes(b"\xffmine")
    for out in (page, tmp_path):
        with pytest.raises(ValueError, match="is there and no comparison"):
            write_comparison(folders, out)
    assert page.read_bytes() == b"\xffmine"
