"""A plugin of pytest: durations are of the processor, so that what a test costs does not depend on what else the machine does."""

import time

import _pytest.timing

_pytest.timing.perf_counter = time.process_time
