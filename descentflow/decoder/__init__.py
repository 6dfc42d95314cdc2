"""From weights to trajectories: drag and CAS, then batched total-energy integration."""
