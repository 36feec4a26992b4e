using System;
using System.IO;
using System.Text;

/// <summary>Named arrays in a file that the tests' Python reads: a line "name f|i|u count", then little-endian 32-bit numbers.</summary>
public sealed class Dump : IDisposable
{
    readonly FileStream file;

    public Dump(string path)
    {
        file = File.Create(path);
    }

    public void Put(string name, Array values)
    {
        string kind = values.GetType() == typeof(float[]) ? "f" : values.GetType() == typeof(uint[]) ? "u" : "i";
        byte[] line = Encoding.UTF8.GetBytes(name + " " + kind + " " + values.Length + "\n");
        file.Write(line, 0, line.Length);
        var raw = new byte[values.Length * 4];
        Buffer.BlockCopy(values, 0, raw, 0, raw.Length);
        file.Write(raw, 0, raw.Length);
    }

    public void Dispose()
    {
        file.Dispose();
    }
}
