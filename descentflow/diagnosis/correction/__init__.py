"""How far the gap shrinks once effects are in the simulator, and the simulator with them."""
