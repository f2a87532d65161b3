"""Networks trained by what a smoother makes of their answers, whatever they measure.

Owns flights as the smoother has linearised them (``flights``), and the likelihood of their truth
as a loss that torch differentiates (``loss``).
"""
