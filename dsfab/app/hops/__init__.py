"""`dsfab hops`: components for Grasshopper. A Hops component there takes the address of this server as it is.

protocol     what Hops asks and is answered, as JSON: parameters, values, units
components   what is offered: Structure, Preview, Members, Workshop parts
solver       one request after the other, in a process that is ended when it takes too long
server       HTTP on this machine alone      command   `dsfab hops`
"""
