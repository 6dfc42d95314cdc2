"""Pictures of samples: bands of quantiles (:mod:`.quantile_bands`), and a page of panels (:mod:`.sampled_profiles`)."""
