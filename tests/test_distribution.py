import numpy as np
import pytest

from subtense.distribution import Distribution
from subtense.errors import InputError

LAWS = [
    Distribution("normal"), Distribution("uniform"), Distribution("triangular"), Distribution("arcsine"),
    Distribution("curvilinear_trapezoid", 0.3), Distribution("one_sided", 1.0), Distribution("one_sided", -1.0),
    Distribution("either", 0.2),
]  # fmt: skip


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_draws_have_unit_root_mean_square_and_the_stated_mean_and_kurtosis(law):
    z = law.draw(np.random.default_rng(1), (400_000,))
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.005)
    assert z.mean() == pytest.approx(law.mean, abs=0.005)
    centred = z - z.mean()
    assert np.mean(centred**4) / np.mean(centred**2) ** 2 - 3 == pytest.approx(law.excess_kurtosis, abs=0.03)


@pytest.mark.parametrize("law", [*LAWS, Distribution("t", 5.0)], ids=str)
@pytest.mark.parametrize("share", [0.025, 0.3, 0.5, 0.9, 0.975])
def test_quantiles_agree_with_draws(law, share):
    z = law.draw(np.random.default_rng(2), (400_000,))
    below = law.quantile(share)
    assert np.mean(z < below - 1e-9) <= share + 0.003
    assert np.mean(z <= below + 1e-9) >= share - 0.003


def test_unknown_law_is_refused_by_name():
    with pytest.raises(InputError, match="cauchy"):
        Distribution("cauchy")


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_json_round_trip(law):
    assert Distribution.from_json(law.to_json()) == law
