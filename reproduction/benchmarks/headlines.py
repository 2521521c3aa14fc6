"""Ten headline numbers, recomputed from the shipped rows with pandas and none of our code.

python reproduction/benchmarks/headlines.py results
"""

import sys

import pandas as pd

folder = sys.argv[1] if len(sys.argv) > 1 else "results"


def rows(name: str) -> pd.DataFrame:
    read = pd.read_csv(f"{folder}/raw/{name}.csv.gz", comment="#", low_memory=False)
    read = read[read["solved_at"].notna()]
    missed = read["solved_at"] == 0
    return read.assign(
        trials=read["solved_at"].where(~missed, read["rounds"] + 1),
        first=read["solved_at"] == 1,
        within_4=~missed & (read["solved_at"] <= 4),
    )


network, papers = rows("sets-network"), rows("papers-form")
drawn = rows("sets")
eye = drawn[drawn["perception"].eq("eye") & (drawn["goal"] > 0)]  # the first goal does not count
by_method = eye.groupby(["method", "task"])["trials"].mean().groupby("method").mean()
first = pd.concat([network, drawn[drawn["labels"] == "exact"]]).groupby("method")["first"].mean()
ours = papers[(papers["method"] == "GP, m = 2") & papers["unseen"].eq(False)]
by_eye = ours[ours["perception"] == "eye"].groupby("task")["trials"].mean()
for what, value in {
    "first-attempt success, diffusion": first["diffusion"],
    "first-attempt success, untrained": first["diffusion, untrained"],
    "first-attempt success, closed form": first["closed form"],
    "trials, the paper's Gaussian process": by_method["GP, m = 2, each goal alone"],
    "trials, Gaussian process of two terms": by_method["GP of two terms, m = 2, each goal alone"],
    "trials, proportional": by_method["proportional, 0.8"],
    "trials, ours, remembering": by_method["Bayesian, earlier goals too"],
    "trials, ridge, remembering": by_method["ridge on the spline's weights, earlier goals too"],
    "the paper's form, within 4": ours[ours["perception"] == "amplified"]["within_4"].mean(),
    "the paper's form, trials on V2": by_eye["basketball-v2"],
}.items():
    print(f"{what}: {value:.2f}")
