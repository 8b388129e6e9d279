"""Motion models of any structure from records: fit, choice by cross-validation, intervals and bands."""
