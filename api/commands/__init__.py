"""The commands of advpipe as functions, under the same names and with the same defaults: `advpipe.simulate`
and the others. The command line parses its options, calls these, and prints what they return."""
