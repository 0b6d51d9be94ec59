from .assembly import Placed as Placed
from .assembly import build as build
from .assembly import place as place
