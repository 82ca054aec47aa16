"""The paper's plant with the Coriolis matrix as printed. docs/paper.md says what it does."""

from dataclasses import dataclass

from hilrig_drivers import two_link
from hilrig_drivers.two_link import Pair, TwoLink, TwoLinkPlant

from hilrig import Command, PlantDisturbance, PlantKernels, TrialStart, kernel
from hilrig.core.compiler import composed


@dataclass(frozen=True)
class DriverAsPrinted(TwoLink):
    """`two_link` whose C has the second row [0, h q2'] instead of [h q1', 0], with h = m2 c2 l1 sin q2.

    M' - 2C is then not skew-symmetric: the arm gains and loses energy on its own.
    """

    def connect(self, start: TrialStart) -> TwoLinkPlant:
        """Return the arm at rest, held there by its motors."""
        return PlantAsPrinted(self, start)


class PlantAsPrinted(TwoLinkPlant):
    """The arm in one trial."""

    def kernels(self) -> PlantKernels:
        """Return the arm as kernels, starting from its current state."""
        return super().kernels()._replace(advance=advance_as_printed)

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        """Integrate one period with the command held."""
        advance_as_printed(self._model, self._state, disturbance, command.torque, command.position)


@kernel
def coriolis_as_printed(h: float, rate1: float, rate2: float) -> Pair:
    """Return C q', N m."""
    return -h * rate2 * (2.0 * rate1 + rate2), h * rate2 * rate2


# The equations of motion and their integration are those of `two_link`, with this C in them.
advance_as_printed = composed(
    two_link.advance.py_func, rates=composed(two_link.rates.py_func, coriolis=coriolis_as_printed)
)
