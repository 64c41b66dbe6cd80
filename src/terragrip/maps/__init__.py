"""Maps of the ground, from estimates with positions (docs/maps.md)."""

from terragrip.maps.field_map import FieldMap, MapMaker, MapSettings, map_of
from terragrip.maps.writing import write_map

__all__ = ["FieldMap", "MapMaker", "MapSettings", "map_of", "write_map"]
