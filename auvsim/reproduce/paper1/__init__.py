"""Paper 1, Qiu and Li (2019): navigation to a dock by USBL."""
