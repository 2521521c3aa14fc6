"""Commands on a workspace as a whole, as a person types them."""

import json


def test_an_afternoon(run, folder):
    assert run("goal", folder, "0.9", "-0.05")[1].startswith("goal 1: 90 cm ahead, 5 cm right")
    status, out, _ = run("ask", folder, "--out", "plan.csv")
    assert status == 0
    assert "no limits checked" in out
    assert 'next: prior-reinforce tell planar 1 --error "5cm long, 2cm left"' in out
    assert run("tell", folder, 1, "--error", "5cm", "long,", "2cm", "left")[0] == 0
    _, out, _ = run("amend", folder, 1, "--error", "-0.05", "0.02")
    assert "trial 1, corrected: 5 cm short, 2 cm left" in out
    run("ask", folder)
    status, out, _ = run("void", folder, 2, "--reason", "ball slipped")
    assert "trial 2: void: ball slipped" in out
    run("ask", folder)
    _, out, _ = run("tell", folder, 3, "--outcome", "0.93", "-0.05")
    assert "trial 3: 3 cm long" in out
    run("ask", folder)
    _, out, _ = run("tell", folder, 4, "--hit")
    assert "trial 4: reached" in out
    _, out, _ = run("status", folder)
    assert "reached in 3 trials (N = 4 demonstrations + 3 = 7)" in out
    assert len(out.splitlines()) <= 10
    assert "this trial repeats it" in run("ask", folder)[1]
    run("void", folder, 5)
    _, out, _ = run("log", folder)
    kinds = [json.loads(line)["kind"] for line in out.splitlines()]
    assert kinds[2:6] == ["goal_set", "asked", "told", "amended"]


def test_a_report_replaces_only_what_it_wrote(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "overview.png").write_bytes(b"mine")
    status, _, err = run("report", folder, "--out", "thesis")
    assert status == 2
    assert "choose an empty or a new folder" in err
    assert (tmp_path / "thesis" / "overview.png").read_bytes() == b"mine"
    for _ in range(2):
        assert run("report", folder)[0] == 0
