using System;
using System.Collections.Generic;
using System.Text;

namespace Gsac
{
    /// <summary>
    /// The bytes of a .gsac file: header, JSON head, blocks (docs/gsac-format.md). Nothing is believed before it is
    /// checked, and memory stays in proportion to the file's real size. Throws GsacException.
    /// </summary>
    public sealed class GsacContainer
    {
        public const int Version = 1;
        public const int MaxFile = 256 << 20;
        const int HeaderSize = 32;
        const int MaxHead = 1 << 20;
        const int MaxBlocks = 1024;
        const int MaxAxes = 4;
        const int MaxLength = 1 << 26;
        const int Align = 16;
        static readonly byte[] Magic = { 0x47, 0x53, 0x41, 0x43, 13, 10, 26, 10 };
        static readonly uint[] CrcTable = MakeCrcTable();

        sealed class Block
        {
            public string Type;
            public int Start;
            public int Count;
            public int[] Shape;
            public double Scale;
            public bool Scaled;
        }

        public Dictionary<string, object> Head { get; private set; }

        readonly byte[] data;
        readonly Dictionary<string, Block> blocks = new Dictionary<string, Block>();

        public GsacContainer(byte[] data)
        {
            this.data = data ?? throw new GsacException(GsacFault.NotGsac, "there are no bytes");
            int start = CheckHeader();
            try
            {
                string text = new UTF8Encoding(false, true).GetString(data, HeaderSize, start - HeaderSize);
                Head = GsacJson.Parse(text) as Dictionary<string, object>;
            }
            catch (FormatException e)
            {
                throw new GsacException(GsacFault.Head, e.Message);
            }
            catch (ArgumentException)
            {
                throw new GsacException(GsacFault.Head, "it is not UTF-8");
            }
            object table;
            if (Head == null || !Head.TryGetValue("blocks", out table) || !(table is Dictionary<string, object>))
            {
                throw new GsacException(GsacFault.Head, "it lacks the table `blocks`");
            }
            ReadTable((Dictionary<string, object>)table, start);
        }

        /// <summary>Checks all that stands before the head and the checksum; returns where the blocks begin.</summary>
        int CheckHeader()
        {
            bool begins = data.Length > 0;
            for (int i = 0; i < Math.Min(Magic.Length, data.Length); i++) begins &= data[i] == Magic[i];
            if (!begins) throw new GsacException(GsacFault.NotGsac, "it does not begin with the GSAC magic bytes");
            if (data.Length < HeaderSize) throw new GsacException(GsacFault.Truncated, "it has " + data.Length + " bytes");
            uint version = U32(8), head = U32(12), crc = U32(24);
            ulong size = U32(16) | ((ulong)U32(20) << 32);
            if (version != Version)
            {
                throw new GsacException(GsacFault.Version, "it has version " + version + ", this reader knows " + Version);
            }
            if (data.Length > MaxFile || size > MaxFile || (ulong)data.Length > size)
            {
                throw new GsacException(GsacFault.Oversized, data.Length + " bytes are there, " + size + " are said, " + MaxFile + " are accepted");
            }
            if ((ulong)data.Length < size)
            {
                throw new GsacException(GsacFault.Truncated, data.Length + " of " + size + " bytes are there");
            }
            ulong start = HeaderSize + (ulong)head;
            if (head > MaxHead || start > size || start % Align != 0 || U32(28) != 0)
            {
                throw new GsacException(GsacFault.Head, "the header gives it " + head + " bytes");
            }
            if (Crc(data, HeaderSize) != crc) throw new GsacException(GsacFault.Checksum, "it was damaged after it was written");
            return (int)start;
        }

        void ReadTable(Dictionary<string, object> table, int start)
        {
            if (table.Count > MaxBlocks) throw new GsacException(GsacFault.Block, "it lists " + table.Count + " blocks");
            var spans = new List<KeyValuePair<long, long>>();
            foreach (KeyValuePair<string, object> pair in table)
            {
                Block block = ReadEntry(pair.Key, pair.Value as Dictionary<string, object>, start);
                blocks[pair.Key] = block;
                spans.Add(new KeyValuePair<long, long>(block.Start, block.Start + (long)block.Count * Size(block.Type)));
            }
            spans.Sort((a, b) => a.Key != b.Key ? a.Key.CompareTo(b.Key) : a.Value.CompareTo(b.Value));
            for (int i = 1; i < spans.Count; i++)
            {
                if (spans[i].Key < spans[i - 1].Value) throw new GsacException(GsacFault.Block, "two blocks overlap");
            }
        }

        Block ReadEntry(string name, Dictionary<string, object> entry, int start)
        {
            if (entry == null) throw Bad(name, "is not an object");
            var block = new Block { Type = Find(entry, "dtype") as string, Scale = 1 };
            if (Size(block.Type) == 0) throw Bad(name, "has an unknown type");
            var lengths = Find(entry, "shape") as List<object>;
            if (lengths == null || lengths.Count > MaxAxes) throw Bad(name, "has a shape that is not a short list of lengths");
            block.Shape = new int[lengths.Count];
            long count = 1;
            bool none = false;
            for (int i = 0; i < lengths.Count; i++)
            {
                if (!(lengths[i] is long) || (long)lengths[i] < 0 || (long)lengths[i] > MaxLength)
                {
                    throw Bad(name, "has a shape that is not a short list of lengths");
                }
                block.Shape[i] = (int)(long)lengths[i];
                none |= block.Shape[i] == 0;
                // the product of four lengths overflows; past the largest file it says no more
                count = Math.Min(count * block.Shape[i], (long)MaxFile + 1);
            }
            if (none) count = 0;
            object offset = Find(entry, "offset");
            if (!(offset is long) || (long)offset < 0 || (long)offset % Align != 0 || (long)offset > MaxFile)
            {
                throw Bad(name, "has a bad offset");
            }
            if (start + (long)offset + count * Size(block.Type) > data.Length) throw Bad(name, "ends after the file");
            block.Start = start + (int)(long)offset;
            block.Count = (int)count;
            object scale;
            if (entry.TryGetValue("scale", out scale))
            {
                if (!(scale is long) && !(scale is double)) throw Bad(name, "has a scale that is not a number");
                block.Scale = Convert.ToDouble(scale);
                block.Scaled = true;
                if (!(Math.Abs(block.Scale) > 0 && Math.Abs(block.Scale) < 1e6)) throw Bad(name, "has a scale that is not a plain number");
            }
            return block;
        }

        public bool Has(string name)
        {
            return blocks.ContainsKey(name);
        }

        /// <summary>Length of a block's first axis; the block must have as many axes as `shape`, -1 stands for any length.</summary>
        Block Get(string name, int[] shape)
        {
            Block block;
            if (!blocks.TryGetValue(name, out block)) throw Bad(name, "is missing");
            bool fits = block.Shape.Length == shape.Length;
            for (int i = 0; fits && i < shape.Length; i++) fits = shape[i] < 0 || shape[i] == block.Shape[i];
            if (!fits) throw Bad(name, "has another shape than expected");
            return block;
        }

        /// <summary>A block of numbers; not finite ones are refused.</summary>
        public float[] Reals(string name, params int[] shape)
        {
            Block block = Get(name, shape);
            if (!block.Scaled && block.Type[0] != 'f') throw Bad(name, "holds whole numbers, real ones are expected");
            var values = new float[block.Count];
            for (int i = 0; i < values.Length; i++)
            {
                double value = Element(block, i);
                if (block.Scaled) value = (float)value * (float)block.Scale;
                values[i] = (float)value;
                if (float.IsNaN(values[i]) || float.IsInfinity(values[i]))
                {
                    throw new GsacException(GsacFault.Value, "block " + name + " is not finite");
                }
            }
            return values;
        }

        /// <summary>A block of whole numbers, each in 0 .. limit - 1.</summary>
        public int[] Indices(string name, long limit, params int[] shape)
        {
            Block block = Get(name, shape);
            if (block.Scaled || block.Type[0] == 'f') throw Bad(name, "holds real numbers, whole ones are expected");
            var values = new int[block.Count];
            for (int i = 0; i < values.Length; i++)
            {
                double value = Element(block, i);
                if (value < 0 || value >= limit || value > int.MaxValue)
                {
                    throw new GsacException(GsacFault.Value, "block " + name + " points outside 0.." + (limit - 1));
                }
                values[i] = (int)value;
            }
            return values;
        }

        double Element(Block block, int i)
        {
            int at = block.Start + i * Size(block.Type);
            switch (block.Type)
            {
                case "f32": return BitConverter.ToSingle(data, at);
                case "f16": return Half(data[at] | data[at + 1] << 8);
                case "u8": return data[at];
                case "u16": return data[at] | data[at + 1] << 8;
                case "i16": return (short)(data[at] | data[at + 1] << 8);
                default: return U32(at);
            }
        }

        static int Size(string type)
        {
            switch (type)
            {
                case "f32": case "u32": return 4;
                case "f16": case "u16": case "i16": return 2;
                case "u8": return 1;
                default: return 0;
            }
        }

        public static float Half(int bits)
        {
            int exponent = (bits >> 10) & 31, fraction = bits & 1023;
            double value = exponent == 0 ? fraction * Math.Pow(2, -24)
                : exponent == 31 ? (fraction == 0 ? double.PositiveInfinity : double.NaN)
                : (1 + fraction / 1024.0) * Math.Pow(2, exponent - 15);
            return (float)((bits & 0x8000) != 0 ? -value : value);
        }

        static object Find(Dictionary<string, object> table, string key)
        {
            object value;
            return table.TryGetValue(key, out value) ? value : null;
        }

        static GsacException Bad(string name, string what)
        {
            return new GsacException(GsacFault.Block, "block " + (name.Length > 60 ? name.Substring(0, 60) : name) + " " + what);
        }

        uint U32(int at)
        {
            return (uint)(data[at] | data[at + 1] << 8 | data[at + 2] << 16 | data[at + 3] << 24);
        }

        static uint[] MakeCrcTable()
        {
            var table = new uint[256];
            for (uint i = 0; i < 256; i++)
            {
                uint c = i;
                for (int k = 0; k < 8; k++) c = (c & 1) != 0 ? (c >> 1) ^ 0xedb88320u : c >> 1;
                table[i] = c;
            }
            return table;
        }

        public static uint Crc(byte[] data, int from)
        {
            uint crc = 0xffffffff;
            for (int i = from; i < data.Length; i++) crc = (crc >> 8) ^ CrcTable[(crc ^ data[i]) & 255];
            return crc ^ 0xffffffff;
        }
    }
}
