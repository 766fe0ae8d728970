#!/usr/bin/env bash
# Prints the generator that this folder's name allows. ninja does not read back the names of headers with other characters
# than these in them, such as '&', and would compile everything each time.
[[ $PWD =~ ^[A-Za-z0-9+,/_:.~@=\ -]*$ ]] && echo Ninja || echo "Unix Makefiles"
