"""Files for structural analysis: CalculiX, OpenSees, SAF and ParaView."""
