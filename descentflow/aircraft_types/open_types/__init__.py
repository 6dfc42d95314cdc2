"""Open aircraft: coefficients in BADA 3 form from open sources, one TOML file for each type."""
