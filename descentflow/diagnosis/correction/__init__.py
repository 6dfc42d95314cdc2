"""Gap that is left once effects are in the simulator, and the simulator with them."""
