"""What a robot is: its bodies, joints and gravity as data, checked; no time passes here."""
from .chain import Chain
from .tree import BASE, Body, Joint
from ..errors import ChainError

__all__ = ['BASE', 'Body', 'Chain', 'ChainError', 'Joint']   # which pickles of version 0.1 look for here
