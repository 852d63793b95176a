"""Beliefs of one kind as beliefs of another."""
