"""A fuzzer for the whole program: bad inputs of every kind that it reads, and what became of them.

python -m scripts.attack --minutes 60

uses        how the program reads each kind of input: command lines that work, and the files in them that are attacked
good        makes those files, by the program itself
words       bad values for every option that a verb's --help names
by_hand     inputs that are known to be bad, and why
mutations   any bytes, texts and JSON, changed at random; `formats` knows Parquet, safetensors, gzip, XML and pictures
oracles     which changed files are bad for certain, by other means than the program's own
attempts    one number, one attempt: by hand first, then at random
runner      runs an attempt in a child process with limits of time, memory and file size
outputs     looks at what was written: whole, readable, numbers within their ranges
verdicts    sorts the outcomes
__main__    the loop, the table, and what is kept of each fault
"""
