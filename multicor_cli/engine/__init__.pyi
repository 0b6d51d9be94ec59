from .contact.problem import ContactProblem as ContactProblem
from .contact.problem import ContactSolution as ContactSolution
from .contact.problem import solve_contacts as solve_contacts
from .contact.settings import PhysicsError as PhysicsError
from .contact.settings import Settings as Settings
from .contact.settings import StepReport as StepReport
from .contact.solve import Interrupted as Interrupted
from .step import Engine as Engine
