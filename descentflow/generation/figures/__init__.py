"""Pictures of what was generated: samples (:mod:`.sampled_profiles`) and predictions (:mod:`.predicted_profiles`)."""
