// Unpacks the arrays that viewer/packing.py packed, for live and exported pages.
"use strict";

function unpackArray({kind, rows, columns, width, bytes, offset, step}) {
  // Byte planes, the lowest byte first; in each plane one column after another.
  const whole = (row, column) => {
    let number = 0;
    for (let plane = width - 1; plane >= 0; plane--) {
      number = 256 * number + bytes[(plane * columns + column) * rows + row];
    }
    return number % 2 ? -(number + 1) / 2 : number / 2;
  };
  const kinds = {Float32Array, Float64Array, Uint8Array, Uint32Array};
  const values = new kinds[kind](rows * columns);
  for (let column = 0; column < columns; column++) {
    for (let row = 0, sum = 0; row < rows; row++) {
      sum += whole(row, column);
      values[row * columns + column] = offset[column] + sum * step[column];
    }
  }
  return values;
}

// Replace the references to arrays by the arrays.
function withArrays(value, arrays) {
  if (value === null || typeof value !== "object" || ArrayBuffer.isView(value)) return value;
  if (Array.isArray(value)) return value.map((item) => withArrays(item, arrays));
  if ("$array" in value) return arrays[value.$array];
  const entries = Object.entries(value).map(([key, item]) => [key, withArrays(item, arrays)]);
  return Object.fromEntries(entries);
}
