"""Flight physics of BADA 3 in descent, batched in torch; every equation of the package stands here, once."""
