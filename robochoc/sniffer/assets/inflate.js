"use strict";
/* Unpacks zlib's bytes (RFC 1950, 1951) without a promise, so that a small page is drawn before its `load` event:
   browsers without a window take a screenshot then. `DecompressionStream` would end later. */
(() => {
  const LENGTHS = [3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258];
  const DISTANCES = [1, 2, 3, 4, 5, 7, 9, 13, 17, 25, 33, 49, 65, 97, 129, 193, 257, 385, 513, 769, 1025, 1537, 2049, 3073,
    4097, 6145, 8193, 12289, 16385, 24577];
  const lengthBits = (at) => (at < 4 || at === 28 ? 0 : (at >> 2) - 1);
  const distanceBits = (at) => (at < 2 ? 0 : (at >> 1) - 1);
  const ORDER = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];

  /* A canonical Huffman code: the number of codes of each length, and the symbols in the order of their codes. */
  const huffman = (lengths) => {
    const counts = new Uint16Array(16);
    for (const length of lengths) counts[length]++;
    counts[0] = 0;
    const symbols = [];
    for (let length = 1; length < 16; length++) lengths.forEach((own, symbol) => own === length && symbols.push(symbol));
    return { counts, symbols };
  };
  const FIXED = [huffman(Array.from({ length: 288 }, (_, symbol) => (symbol < 144 ? 8 : symbol < 256 ? 9 : symbol < 280 ? 7 : 8))),
    huffman(Array(30).fill(5))];

  Sniffer.inflate = (packed) => {
    let at = 2; // after zlib's header
    let held = 0;
    let count = 0;
    let room = new Uint8Array(packed.length * 8);
    let size = 0;

    const bits = (many) => {
      while (count < many) {
        if (at >= packed.length) throw new Error("its data are incomplete");
        held |= packed[at++] << count;
        count += 8;
      }
      const value = held & ((1 << many) - 1);
      held >>>= many;
      count -= many;
      return value;
    };
    const symbol = ({ counts, symbols }) => {
      let code = 0;
      let first = 0;
      let before = 0;
      for (let length = 1; length < 16; length++) {
        code |= bits(1);
        if (code - first < counts[length]) return symbols[before + code - first];
        before += counts[length];
        first = (first + counts[length]) << 1;
        code <<= 1;
      }
      throw new Error("its data are damaged");
    };
    const reserve = (more) => {
      if (size + more <= room.length) return;
      const larger = new Uint8Array(Math.max(room.length * 2, size + more));
      larger.set(room);
      room = larger;
    };
    const stored = () => {
      held = count = 0;
      const length = packed[at] | (packed[at + 1] << 8);
      reserve(length);
      room.set(packed.subarray(at + 4, at + 4 + length), size);
      at += 4 + length;
      size += length;
    };
    const codes = () => {
      const literals = bits(5) + 257;
      const distances = bits(5) + 1;
      const own = Array(19).fill(0);
      for (let i = 0, many = bits(4) + 4; i < many; i++) own[ORDER[i]] = bits(3);
      const code = huffman(own);
      const lengths = [];
      while (lengths.length < literals + distances) {
        const next = symbol(code);
        if (next < 16) lengths.push(next);
        else {
          const value = next === 16 ? lengths[lengths.length - 1] : 0;
          for (let i = next === 16 ? bits(2) + 3 : next === 17 ? bits(3) + 3 : bits(7) + 11; i > 0; i--) lengths.push(value);
        }
      }
      return [huffman(lengths.slice(0, literals)), huffman(lengths.slice(literals, literals + distances))];
    };
    const compressed = ([literals, distances]) => {
      for (;;) {
        const next = symbol(literals);
        if (next === 256) return;
        reserve(258);
        if (next < 256) room[size++] = next;
        else {
          const length = LENGTHS[next - 257] + bits(lengthBits(next - 257));
          const far = symbol(distances);
          const from = size - DISTANCES[far] - bits(distanceBits(far));
          if (!(from >= 0)) throw new Error("its data are damaged");
          for (let i = 0; i < length; i++) room[size++] = room[from + i];
        }
      }
    };

    for (let last = 0; !last; ) {
      last = bits(1);
      const kind = bits(2);
      if (kind === 0) stored();
      else compressed(kind === 1 ? FIXED : codes());
    }
    return room.buffer.slice(0, size);
  };
})();
