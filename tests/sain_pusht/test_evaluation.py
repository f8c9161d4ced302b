"""Results of gym-pusht stand on the page of all results."""

from pathlib import Path

from sain_eval.loop.realities import read_results
from sain_eval.loop.results_page import results_page
from sain_pusht.episode import PushtRecord
from sain_pusht.evaluation import write_pusht_results


def test_gym_pusht_is_a_reality(tmp_path: Path) -> None:
    error = {"planning_s": (0.1,), "error_mm": (1.0, 3.0), "error_deg": (0.0, 0.0)}
    records = [
        PushtRecord(seed, seed > 0, 40 + seed, 10, 4 + seed, 0, 0.9, **error) for seed in range(3)
    ]
    for model in ("pusht", "oracle"):
        folder = tmp_path / model
        folder.mkdir()
        write_pusht_results(folder, records, {"model": model}, f"pusht --model {model}")
    results = [read_results(tmp_path / name) for name in ("pusht", "oracle")]
    lines = results_page(results, {}).replace("\u00a0", " ").splitlines()
    assert "| scenario | within | SAIN trained there | oracle |" in lines
    assert "| `gym-pusht` | 95 % covered | 2/3, 5.5 | 2/3, 5.5 |" in lines
    cell = "**2/3** (21-94 %), 5.5 pushes, 41.0 steps, 2.0 mm"
    assert f"| 95 % covered | SAIN trained there | {cell} |" in lines
    assert "pusht --model oracle" in lines
