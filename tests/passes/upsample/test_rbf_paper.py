"""`rbf_paper`: radial basis functions as the text has them, against its equations [KJ16 Eqs. 1 to 3]."""

from __future__ import annotations

import numpy as np
import pytest

from tests.passes.reference.gbuffers import plane_gbuffer
from tests.passes.reference.image import random_view
from tests.passes.reference.radial_basis import rbf, rbf_paper
from tests.passes.reference.refining import CULLED
from tests.passes.reference.run import Runner, assert_not_within, assert_within
from tests.passes.upsample.cases import constant, fragments, quilt_case, random_case
from tests.passes.upsample.test_rbf import run_rbf
from tests.passes.upsample.test_rbf_samples import random_extras


@pytest.mark.parametrize("with_extras", [False, True])
@pytest.mark.parametrize("size", [(64, 48), (37, 21)])
def test_the_paper_s_form_agrees_with_its_equations(
    runner: Runner, rng: np.random.Generator, size: tuple[int, int], with_extras: bool
) -> None:
    # with holes nearly all fragments are small, without them some are large
    case = quilt_case(rng, size) if with_extras else random_case(runner, rng, size)
    extras = random_extras(rng, case) if with_extras else None
    found = run_rbf(runner, case, extras=extras, paper=True)
    expected, clear = rbf_paper(case, extras)
    assert clear.mean() > 0.6
    # its matrix may be nearly singular, and amplifies what rounding leaves
    assert_within(found[clear], expected[clear], 2e-3 * max(np.abs(expected).max(), 1), "irradiance")
    other, both = rbf(case, extras=extras)
    assert_not_within(found[clear & both], other[clear & both], 2e-3)


def test_the_paper_s_form_keeps_no_constant(runner: Runner, rng: np.random.Generator) -> None:
    """On a bare wall in even light its sum without a constant sags between samples; ours does not."""
    view = random_view(rng, 64, 64)
    limits = {"depth_threshold": 0.05, "normal_threshold": 0.25, "metrics": (3, 2)}
    case = fragments(runner, rng, view, plane_gbuffer(view, 0.0), 3, **limits)
    case.at[case.at == CULLED] = 0
    expected = constant(case, 0.7)
    assert_within(run_rbf(runner, case)[case.shaded], expected[case.shaded], 1e-6, "irradiance")
    assert_not_within(run_rbf(runner, case, paper=True)[case.shaded], expected[case.shaded], 0.02)
