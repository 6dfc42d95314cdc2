"""Samples in documents, Parquet with units and CF, read by the programs that check such files."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from export_toys import WHERE

import descentflow as df
from descentflow.cli.entry import main
from descentflow.core.errors import ConfigError, DataError
from descentflow.exports.export import export
from descentflow.exports.targets import TARGETS
from descentflow.generation.sample_columns import COLUMNS


@pytest.fixture(scope="module")
def table(a320: Path) -> pl.DataFrame:
    return df.sample(a320, 12, seed=4).placed(**WHERE).to_polars()


def test_the_document_beside_a_plugin_has_the_samples(a320: Path, table: pl.DataFrame, tmp_path: Path) -> None:
    _, beside = export(a320, "bluesky", tmp_path / "s.py", n=12, seed=4)
    content = json.loads(beside.read_text())
    (fleet,) = content["fleet"]
    assert (fleet["types"], fleet["seed"], len(fleet["samples"])) == (["A320"], 4, 12)
    for number, sample in enumerate(fleet["samples"]):
        assert sample.keys() == {"level_fl", "vertical_rate", "CAS"}
        for name, values in sample.items():
            np.testing.assert_allclose(values, table.filter(sample_id=number)[name], atol=6e-5)


def test_every_field_of_the_parquet_says_its_unit(a320: Path, table: pl.DataFrame, tmp_path: Path) -> None:
    io = pytest.importorskip("arro3.io", reason="arro3 is an extra of descentflow (parquet-units)")
    (path,) = export(a320, "parquet", tmp_path / "s.parquet", n=12, seed=4, **WHERE)
    fields = io.read_parquet(path).schema
    metadata = {name: fields.field(name).metadata_str for name in fields.names}
    assert metadata["vertical_rate"]["units"] == "ft/min"
    assert {name: about["units"] for name, about in metadata.items()} == {
        name: COLUMNS[name].udunit for name in metadata
    }
    assert pl.read_parquet_metadata(path)["checkpoint"] == a320.name
    again = pl.read_parquet(path)
    assert again.select(table.columns).drop("timestamp").equals(table.drop("timestamp"))
    apart = again.filter(level_fl=150)["timestamp"].diff().drop_nulls().dt.total_seconds()
    assert apart.to_list() == [120] * 11, "one flight after the other"


def test_the_cf_file_passes_the_compliance_checker(a320: Path, table: pl.DataFrame, tmp_path: Path) -> None:
    runner = pytest.importorskip(
        "compliance_checker.runner", reason="compliance-checker checks the file; part of the test extra"
    )
    netcdf = pytest.importorskip("netCDF4", reason="netCDF4 is an extra of descentflow (wind)")
    (path,) = export(a320, "cf", tmp_path / "s.nc", n=12, seed=4, **WHERE)
    suite = runner.CheckSuite()
    suite.load_all_available_checkers()
    passed, errors = runner.ComplianceChecker.run_checker(
        str(path), ["cf:1.11"], 0, "strict", output_filename=str(tmp_path / "report.json"), output_format="json"
    )
    report = json.loads((tmp_path / "report.json").read_text())["cf:1.11"]
    messages = [one["msgs"] for level in ("high", "medium", "low") for one in report[f"{level}_priorities"]]
    assert [message for message in messages if message] == []
    assert passed
    assert not errors
    with netcdf.Dataset(path) as file:
        one = table.filter(sample_id=7)
        np.testing.assert_array_equal(file["TAS"][7].compressed(), one["TAS"])
        np.testing.assert_array_equal(file["lat"][7].compressed(), one["latitude"])
        assert (file.checkpoint, file.seed) == (a320.name, "4")
        assert file["TAS"].standard_name == "platform_speed_wrt_air"
        assert file["time"][7].compressed()[-1] - file["time"][6].compressed()[-1] == 120


@pytest.mark.parametrize(
    ("to", "name", "said", "message"),
    [
        ("yaml", "s.yaml", {}, "target 'yaml'"),
        ("json", "s.json", {}, "target 'json'; expected one of parquet, cf"),
        ("parquet", "s.txt", {}, r"output s\.txt for parquet"),
        ("cf", "s.nc", {}, "cf without places"),
        ("cf", "s.nc", {"end": (52.0, 4.0), "track": 90.0}, "cf without a time; .* give --time 2026"),
        (
            "cf",
            "s.nc",
            {"end": (52.0, 4.0)},
            "cf without a track at the end point and a time; .* give --track DEG --time",
        ),
        (
            "traffic",
            "s.parquet",
            {},
            "traffic without places and a time; .* give --end LAT,LON --track DEG --time 2026",
        ),
        ("traffic", "s.parquet", {"route": [(52.0, 4.0), (52.0, 5.0)]}, "traffic without a time; .* give --time 2026"),
        ("parquet", "s.parquet", {"n": 0}, "n = 0"),
        ("parquet", "s.parquet", {"every_s": 1e300}, r"every_s = 1e\+300; expected a finite number, from 0 to"),
        (
            "bluesky",
            "s.scn",
            {"step_s": 1.0},
            r"step_s = 1\.0 for bluesky; expected parquet or cf or traffic, which can",
        ),
        ("bluesky", "s.scn", {"precision": "float32"}, "precision = float32 for bluesky; expected onnx"),
    ],
)
def test_what_a_target_cannot_serve_is_refused(
    a320: Path, tmp_path: Path, to: str, name: str, said: dict, message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        export(a320, to, tmp_path / name, **said)
    assert list(tmp_path.iterdir()) == []


def test_the_command_lists_the_targets_and_writes(a320: Path, tmp_path: Path, capsys) -> None:
    with pytest.raises(SystemExit):
        main(["export", "--help"])
    said = capsys.readouterr().out
    assert all(f"  {name} " in said and target.purpose in said for name, target in TARGETS.items())
    assert main(["export", str(a320), "--to", "bluesky", "--out", str(tmp_path / "s.py"), "-n", "3"]) == 0
    assert f"wrote {tmp_path / 's.json'}" in capsys.readouterr().out
    assert main(["export", str(a320), "--to", "cf", "--out", str(tmp_path / "s.nc"), "-n", "3"]) == 2
    assert "cf without places" in capsys.readouterr().err
    words = ["export", str(a320), str(a320), "--to", "bluesky", "--as", "A319,A320", "A321", "-n", "2"]
    assert main([*words, "--out", str(tmp_path / "fleet.py")]) == 0
    fleet = json.loads((tmp_path / "fleet.json").read_text())["fleet"]
    assert [model["types"] for model in fleet] == [["A319", "A320"], ["A321"]]
    assert main(["export", str(a320), str(tmp_path / "no.ckpt"), "--to", "bluesky", "--out", "x.py"]) == 2
    assert "no.ckpt" in capsys.readouterr().err
    with pytest.raises(DataError, match="does not exist"):
        export(a320, "bluesky", tmp_path / "nowhere" / "s.py")


@pytest.mark.parametrize(("to", "name"), [("bluesky", "k.py"), ("bluebird", "k.py")])
def test_samples_of_another_export_are_not_written_over(a320: Path, tmp_path: Path, to: str, name: str) -> None:
    samples = tmp_path / "k.json"
    samples.write_bytes(before := b"somebody else's")
    with pytest.raises(ConfigError, match=r"k.json, which belongs to something else.*k.py"):
        export(a320, to, tmp_path / name, n=4)
    assert samples.read_bytes() == before
    assert not (tmp_path / name).exists()
    samples.unlink()
    export(a320, to, tmp_path / name, n=4)
    assert export(a320, to, tmp_path / name, n=5)[0] == tmp_path / name, "its own is written again"
