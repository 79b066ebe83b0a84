"""Building models: IFC4."""
