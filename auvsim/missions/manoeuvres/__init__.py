"""Standard manoeuvres from which a vehicle is identified, and what their logs say."""
