from .contact.problem import ContactProblem as ContactProblem
from .contact.problem import ContactSolution as ContactSolution
from .contact.problem import solve_contacts as solve_contacts
from .contact.solve import Interrupted as Interrupted
from .contact.solve import Settings as Settings
from .contact.step_report import PhysicsError as PhysicsError
from .contact.step_report import StepReport as StepReport
from .step import Engine as Engine
