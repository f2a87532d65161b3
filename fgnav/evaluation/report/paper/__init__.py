"""A report for print: pages by matplotlib, as one PDF or a PNG of each."""
