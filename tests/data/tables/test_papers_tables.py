"""From a download to the paper's tables and figures, on miniatures in the data sets' own layouts."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bags import robot
from miniatures import miniature
from replicas import write_replica
from scannet_writer import Scan, scan, write_raw
from scannetpp_writer import write_scan

from semgs.cli.main import main
from semgs.data.origin.terms import TermsWarning
from semgs.model.weights.load import trained_scenes

ROOT = Path(__file__).resolve().parents[3]
TRAIN = "small --init small --batch 1 --size 48x64 --contexts 2 2 --targets 1 --validation-scenes 0 --workers 0"

pytest.importorskip("embreex")


def repeated(written: Scan, times: int) -> Scan:
    """A recording that shows the same frames again and again."""
    return Scan(
        np.concatenate([written.poses] * times),
        written.jpegs * times,
        np.concatenate([written.depths] * times),
        np.concatenate([written.ids] * times),
        np.concatenate([written.labels] * times),
    )


def command(*words: object) -> None:
    """Run a command line, which has to end well."""
    assert main([str(word) for word in words]) == 0


@pytest.mark.long
def test_a_download_becomes_weights_a_table_beside_the_papers_and_a_figure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semgs.evaluation.scoring.intervals.RESAMPLES", 50)
    written = scan(lost=())
    for name in ("scene0001_00", "scene0160_01", "scene0160_00"):
        write_raw(tmp_path / name, written, name)
        (tmp_path / "scannet/scans").mkdir(parents=True, exist_ok=True)
        (tmp_path / name / "scans" / name).rename(tmp_path / "scannet/scans" / name)
    (tmp_path / "scene0001_00/scannetv2-labels.combined.tsv").rename(tmp_path / "scannet/scannetv2-labels.combined.tsv")
    (tmp_path / "train.txt").write_text("scene0001_00\n")
    (tmp_path / "test.txt").write_text("scene0160_00\n")
    scans, data = tmp_path / "scannet/scans", tmp_path / "data"
    command("prepare", scans, data, "--scenes", tmp_path / "train.txt", "--size", "48x64", "--workers", 0)
    command("train", *TRAIN.split(), "--steps", 1, "--data", data, "--out", tmp_path / "run")
    weights = tmp_path / "run/weights.safetensors"
    assert trained_scenes(weights) == ("learned", "scene0001_00")
    told = ("--data", scans, "--scenes", tmp_path / "test.txt", "--protocol", "peers", "--size", "48x64")
    with pytest.warns(TermsWarning, match="ScanNet Terms of Use"):
        command("evaluate", weights, *told, "--views", 2, "--out", tmp_path / "eval")
    report = json.loads((tmp_path / "eval/report.json").read_text())
    (frames,) = report["frames"]["scenes"]
    assert frames["scene"] == "scene0160_00"
    assert [(one["target"], sorted(one["contexts"])) for one in frames["samples"]] == [
        ("color/2.jpg", ["color/0.jpg", "color/5.jpg"])
    ]
    capsys.readouterr()
    command("compare", tmp_path / "eval", "--layout", "paper", "--published", "scannet", "--format", "latex")
    table = capsys.readouterr().out
    assert table.index("SemGS $^\\ddagger$ & 0.754") < table.index("small & ")
    theirs = f"S-Ray={tmp_path / 'eval/predictions'}"
    with pytest.warns(TermsWarning, match="ScanNet Terms of Use"):
        command(
            "figure", "qualitative", "--weights", weights, *told, "--predictions", theirs, "--out", tmp_path / "figure"
        )
    (part,) = json.loads((tmp_path / "figure/figure.json").read_text())["parts"]
    methods = part["frames"][0]["methods"]
    assert methods["S-Ray"] == methods["ours"], "ours, drawn again"
    assert methods["ours"]["miou_per_image"] == pytest.approx(report["results"][0]["miou_per_image"])
    assert (tmp_path / "figure/figure.png").read_bytes().startswith(b"\x89PNG")
    # Another scan of a room that was trained in is no test.
    (tmp_path / "test.txt").write_text("scene0160_01\n")
    seen = ("prepare", scans, tmp_path / "seen", "--scenes", tmp_path / "test.txt", "--size", "48x64", "--workers", 0)
    command(*seen)
    line = TRAIN.replace("--validation-scenes 0", "--validation-scenes 1").split()
    refused = ["train", *line, "--steps", 1, "--data", data, tmp_path / "seen", "--validation", scans]
    refused += ["--out", tmp_path / "never"]
    assert main([str(word) for word in refused]) == 2
    assert "scene0160_00 (as scene0160_01)" in capsys.readouterr().err


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Downloads of ScanNet (four scans, two for the test), ScanNet++ (twelve, ten of them held out) and Replica, a robot's bag, and a semgs to call."""
    monkeypatch.setenv("SEMGS_CACHE", str(tmp_path / "cache"))
    for number in range(4):
        name = f"scene{160 + number:04d}_00"
        write_raw(tmp_path / name, repeated(scan(lost=()), 4), name)
        (tmp_path / "scannet/scans").mkdir(parents=True, exist_ok=True)
        (tmp_path / name / "scans" / name).rename(tmp_path / "scannet/scans" / name)
        (tmp_path / name / "scannetv2-labels.combined.tsv").replace(tmp_path / "scannet/scannetv2-labels.combined.tsv")
    first = write_scan(tmp_path / "scannetpp", "0a76e06400")
    for number in range(1, 12):
        (first.parent / f"0a76e064{number:02d}").symlink_to(first)
    (tmp_path / "scannetpp/splits").mkdir()
    names = [f"0a76e064{number:02d}\n" for number in range(12)]
    (tmp_path / "scannetpp/splits/nvs_sem_train.txt").write_text("".join(names[:11]).rstrip())
    (tmp_path / "scannetpp/splits/nvs_sem_val.txt").write_text(names[11])
    write_replica(tmp_path / "replica/office_0/Sequence_1", miniature())
    robot(miniature()).write(tmp_path / "robot")
    (tmp_path / "train.txt").write_text("scene0161_00\nscene0162_00\n")
    (tmp_path / "test.txt").write_text("scene0160_00\nscene0163_00\n")
    semgs = tmp_path / "semgs"
    semgs.write_text(
        f"#!/bin/sh\nexec '{sys.executable}' -c 'import sys; from semgs.cli.main import main; sys.exit(main())' \"$@\"\n"
    )
    semgs.chmod(0o755)
    return tmp_path


@pytest.mark.long
@pytest.mark.timeout(3000)
@pytest.mark.filterwarnings("ignore::semgs.data.origin.terms.TermsWarning")
def test_the_scripts_of_all_tables_and_the_three_figures_run_on_miniatures(world: Path) -> None:
    size = "--size 48x64"
    told = {
        "SEMGS": str(world / "semgs"), "TRAIN": f"{TRAIN.replace('--init small', '--init random')} --steps 20", "EVALUATE": size, "EVERY": "1",
        "TRAIN_LIST": str(world / "train.txt"), "TEST_LIST": str(world / "test.txt"), "FORMAT": "text",
    }  # fmt: skip
    work = world / "work"

    def script(name: str, *arguments: Path, **more: str) -> str:
        environment = {**os.environ, "PYTHONPATH": str(ROOT), **told, **more}
        line = [str(ROOT / "scripts" / f"{name}.sh"), *map(str, arguments)]
        done = subprocess.run(line, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout

    first = script("table1_scannet", world / "scannet", work)
    assert [first.count(f"{views} input views") for views in (2, 3, 4)] == [1, 1, 1]
    assert "published, not run here" in first
    second = script("table2_scannetpp", world / "scannetpp", work, VIEWS="2")
    assert "SemGS ‡" in second
    index = json.loads((work / "data/scannetpp/index.json").read_text())
    report = json.loads((work / "eval/scannetpp/report.json").read_text())
    tested = {scene["name"] for scene in report["data"]["scenes"]}
    assert (len(index["scenes"]), len(tested)) == (2, 10)
    assert not tested & {scene["name"] for scene in index["scenes"]}
    third = script("table3_ablation", world / "scannet", work)  # its full row is Table 1's run, so both start alike
    rows = [line.split("  ")[0] for line in third.splitlines()]
    assert {"none", "+ Sh-Layer", "+ Sw-Trans", "+ C-Inj", "+ Sm-Loss", "+ Sm-Loss ‡"} <= set(rows)
    # Zero-shot: what the weights of Table 1 never saw; the robot's recording has no labels.
    elsewhere = (world / "scannetpp/data/0a76e06400", world / "replica", world / "robot")
    ours = script("table_zero_shot", work, *elsewhere, VIEWS="2")
    for name in ("0a76e06400", "office_0_Sequence_1", "robot"):
        assert f"ours on {name} (1 scene), 2 views" in ours
    figures = {
        "qualitative": (work / "runs/scannet/weights.safetensors", work / "runs/scannetpp/weights.safetensors"),
        "generalisation": (work / "runs/scannet/weights.safetensors",),
        "smoothness": (
            work / "ablation/seed_0/camera/run/weights.safetensors",
            work / "runs/scannet/weights.safetensors",
        ),
    }
    (world / "held.txt").write_text(sorted(tested)[0] + "\n")
    for kind, weights in figures.items():
        if kind == "generalisation":
            told_of = ["--data", world / "replica", world / "robot"]
        else:
            lists = [world / "test.txt", world / "held.txt"][: len(weights) if kind == "qualitative" else 1]
            scans = [world / "scannet/scans", world / "scannetpp/data"][: len(lists)]
            told_of = ["--data", *scans, "--scenes", *lists]
        command(
            "figure", kind, "--weights", *weights, *told_of, "--protocol", "peers", *size.split(), "--out", work / kind
        )
        parts = json.loads((work / kind / "figure.json").read_text())["parts"]
        assert len(parts) == (1 if kind == "smoothness" else 2)
        columns = {name for part in parts for frame in part["frames"] for name in frame["methods"]}
        assert columns == ({"without smoothness", "with smoothness"} if kind == "smoothness" else {"ours"})
