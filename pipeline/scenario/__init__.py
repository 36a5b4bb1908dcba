"""The scenario file, which describes one drive."""

from advpipe.pipeline.core.shipped_scenarios import shipped_scenarios
from advpipe.pipeline.scenario.load import dump_scenario, load_scenario
from advpipe.pipeline.scenario.models import Scenario

__all__ = ["Scenario", "dump_scenario", "load_scenario", "shipped_scenarios"]
