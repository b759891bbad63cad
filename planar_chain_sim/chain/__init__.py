"""What a robot is: its bodies, joints and gravity as data, checked; no time passes here."""
from .chain import Chain
from .tree import BASE, Body, Joint

__all__ = ['BASE', 'Body', 'Chain', 'Joint']
