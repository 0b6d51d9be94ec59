"""One time step of the mechanics, and the contact solver on its own."""

from multicor_cli.solver.contact_table import ContactTable
from multicor_cli.solver.engine import Engine
from multicor_cli.solver.problem import ContactProblem, ContactSolution, solve_contacts
from multicor_cli.solver.settings import PhysicsError, Settings, StepReport
from multicor_cli.solver.solve import Interrupted

__all__ = [
    "ContactProblem",
    "ContactSolution",
    "ContactTable",
    "Engine",
    "Interrupted",
    "PhysicsError",
    "Settings",
    "StepReport",
    "solve_contacts",
]
