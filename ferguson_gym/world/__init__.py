"""Problem definition: fields of obstacles, limits, actions, feasibility and outcomes.

A `Field` has `Obstacles` (discs, capsules, polygons), start, goal and bounds; `get_field` and
`get_fields` find fields by name, and a `FieldPool` has those from which resets draw. `encode` and
`decode` translate between segments and actions, `inspect` and `is_feasible` certify segments, and
`advance` flies one action from a `State` to the next.
"""

from ferguson_gym.world.actions import Action as Action
from ferguson_gym.world.actions import decode as decode
from ferguson_gym.world.actions import encode as encode
from ferguson_gym.world.feasibility import Inspection as Inspection
from ferguson_gym.world.feasibility import inspect as inspect
from ferguson_gym.world.feasibility import is_feasible as is_feasible
from ferguson_gym.world.field import Field as Field
from ferguson_gym.world.field_names import get_field as get_field
from ferguson_gym.world.field_names import get_fields as get_fields
from ferguson_gym.world.field_pool import FieldPool as FieldPool
from ferguson_gym.world.limits import PAPER_LIMITS as PAPER_LIMITS
from ferguson_gym.world.limits import Limits as Limits
from ferguson_gym.world.obstacles import Obstacles as Obstacles
from ferguson_gym.world.outcome import Outcome as Outcome
from ferguson_gym.world.transition import State as State
from ferguson_gym.world.transition import Step as Step
from ferguson_gym.world.transition import advance as advance
from ferguson_gym.world.transition import fly_segment as fly_segment
from ferguson_gym.world.transition import initial_state as initial_state
from ferguson_gym.world.turn_radius import keeps_turn_radius as keeps_turn_radius
