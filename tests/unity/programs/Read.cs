using System;
using System.Collections.Generic;
using System.IO;
using Gsac;

/// <summary>`dump FILE OUT`: all that the reader finds. `faults FOLDER`: each file's name and its fault, or ok.</summary>
public static class Read
{
    public static int Main(string[] args)
    {
        if (args[0] == "dump")
        {
            using (var dump = new Dump(args[2])) Write(GsacData.Read(File.ReadAllBytes(args[1])), dump);
            return 0;
        }
        foreach (string path in Directory.GetFiles(args[1]))
        {
            string word = "ok";
            try
            {
                GsacData.Read(File.ReadAllBytes(path)).Mirror();
            }
            catch (GsacException e)
            {
                word = GsacException.Word(e.Fault);
            }
            Console.WriteLine(Path.GetFileName(path) + " " + word);
        }
        return 0;
    }

    static void Write(GsacData data, Dump dump)
    {
        dump.Put("vertices", data.Vertices);
        dump.Put("faces", data.Faces);
        dump.Put("joints", data.Joints);
        dump.Put("parents", data.Parents);
        dump.Put("skin_index", data.SkinIndex);
        dump.Put("skin_weight", data.SkinWeight);
        dump.Put("expression_start", data.ExpressionStart);
        if (data.Correctives != null)
        {
            dump.Put("corrective_start", data.Correctives.Start);
            dump.Put("corrective_joint", data.Correctives.Joint);
            dump.Put("corrective_delta", data.Correctives.Delta);
        }
        dump.Put("expression_vertex", data.ExpressionVertex);
        dump.Put("expression_delta", data.ExpressionDelta);
        dump.Put("jaw_actions", data.ExpressionJaw);
        dump.Put("face", data.Levels[0].Face);
        dump.Put("mu", data.Levels[0].Mu);
        dump.Put("quat", data.Levels[0].Quat);
        dump.Put("log_scale", data.Levels[0].LogScale);
        dump.Put("rgb", data.Levels[0].Rgb);
        dump.Put("opacity", data.Levels[0].Opacity);
        if (data.Light != null) dump.Put("light", data.Light);
        dump.Put("blend", new float[] { data.LowPass, data.AlphaMax, data.AlphaMin, data.Ground, data.KeepsEnergy ? 1 : 0 });
        dump.Put("heights", Array.ConvertAll(data.Levels, level => level.MaxHeight));
        foreach (KeyValuePair<string, GsacClip> pair in data.Clips) Write("clip." + pair.Key, pair.Value, dump);
        foreach (KeyValuePair<string, GsacClip> pair in data.Poses) Write("pose." + pair.Key, pair.Value, dump);
        Console.WriteLine(string.Join(" ", data.JointNames));
        Console.WriteLine(string.Join(" ", data.Expressions));
        Console.WriteLine(data.Licence["avatar"]);
    }

    static void Write(string name, GsacClip clip, Dump dump)
    {
        dump.Put(name + ".joints", clip.Joints);
        dump.Put(name + ".rotation", clip.Rotation);
        dump.Put(name + ".transl", clip.Transl);
        dump.Put(name + ".fps", new float[] { clip.Fps, clip.Loop ? 1 : 0 });
    }
}
