function number = int64_of(text)
%INT64_OF  Of a text: a double would lose its last digits.
number = int64(0);
for digit = text(text >= '0' & text <= '9'), number = number * 10 + int64(digit - '0'); end
if text(1) == '-', number = -number; end
end
