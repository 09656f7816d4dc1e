"""Flying policies through fields: one flight or a batch of flights, and their metrics.

`fly` flies any policy in the environment, with a hook on each step; `fly_batch` flies a learned
policy through many fields at once. Both return a `Flight`. `FieldChanges` are what a command
changes in all fields before they are flown.
"""

from agents.flights.batched import fly_batch as fly_batch
from agents.flights.field_changes import FieldChanges as FieldChanges
from agents.flights.flight import Flight as Flight
from agents.flights.flight import StepData as StepData
from agents.flights.flight import fly as fly
