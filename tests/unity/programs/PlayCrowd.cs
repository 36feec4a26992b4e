using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using Gsac;
using UnityEngine;

/// <summary>Several people before one camera: all that is asked of the GPU, and what it costs when they part and rest.</summary>
public static class Crowd
{
    static readonly string[] Ints =
    {
        "GsacVertexCount", "GsacSplatCount", "GsacIndexBits", "GsacSortStage", "GsacSortShift", "GsacSortStrides", "GsacJoinFirst",
    };
    static readonly string[] Vectors =
    {
        "GsacDepthRange", "GsacDepthRow", "GsacLightRed", "GsacLightGreen", "GsacLightBlue",
        "GsacSceneRed", "GsacSceneGreen", "GsacSceneBlue", "GsacSceneRed2", "GsacSceneGreen2", "GsacSceneBlue2", "GsacSceneLast", "GsacJoinModel0", "GsacJoinModel1", "GsacJoinModel2",
    };
    static readonly string[] Bound =
    {
        "GsacRest", "GsacSkin", "GsacMoves", "GsacWeights", "GsacBones", "GsacPosed", "GsacCorners", "GsacLocal", "GsacSplats", "GsacKeys",
        "GsacColours", "GsacJoined", "GsacJoinedColours",
    };
    static readonly string[] Drawn = { "GsacModel0", "GsacModel1", "GsacModel2", "GsacBlend", "GsacTint", "GsacIndexBits", "GsacKeepsEnergy", "GsacNumber" };

    static void Put(List<float> row, Vector4 v)
    {
        row.AddRange(new[] { v.x, v.y, v.z, v.w });
    }

    /// <summary>file, numbers, where to write, "apart" or "together"; then of each person x, z, turn in degrees, size.</summary>
    public static void Print(string[] args)
    {
        var people = new List<GameObject>();
        for (int i = 5; i < args.Length; i += 4)
        {
            GsacAvatar avatar = Play.Posed(args[1], Play.Numbers(args[2]));
            float[] place = Array.ConvertAll(new[] { args[i], args[i + 1], args[i + 2], args[i + 3] }, w => float.Parse(w, CultureInfo.InvariantCulture));
            avatar.transform.SetPositionAndRotation(new Vector3(place[0], 0, place[1]), Quaternion.Euler(0, place[2], 0));
            avatar.transform.localScale = new Vector3(place[3], place[3], place[3]);
            if (args[4] == "apart") avatar.GetComponent<GsacRenderer>().Opacity = 1 - i * 1e-6f;
            people.Add(avatar.gameObject);
        }
        Camera camera = Player.AddCamera("eye");
        camera.transform.SetPositionAndRotation(new Vector3(0.3f, 1.4f, 3), Quaternion.Euler(5, 186, 0));
        using (var dump = new Dump(args[3]))
        {
            var known = new List<GraphicsBuffer>();
            List<float> steps = new List<float>(), draws = new List<float>();
            Func<GraphicsBuffer, float> number = buffer =>
            {
                if (buffer == null) return -1;
                if (!known.Contains(buffer))
                {
                    dump.Put("buffer" + known.Count, (uint[])Player.Words(buffer).Clone());
                    known.Add(buffer);
                }
                return known.IndexOf(buffer);
            };
            Player.OnDispatch = (shader, kernel, groups) =>
            {
                steps.Add(kernel);
                steps.Add(groups);
                foreach (string name in Ints) steps.Add(Player.Value(shader, Shader.PropertyToID(name)).x);
                foreach (string name in Vectors) Put(steps, Player.Value(shader, Shader.PropertyToID(name)));
                foreach (string name in Bound) steps.Add(number(Player.Buffer(shader, kernel, Shader.PropertyToID(name))));
            };
            Player.OnDraw = (asked, indices, count) =>
            {
                foreach (string name in Drawn) Put(draws, Player.Value(asked.matProps, Shader.PropertyToID(name)));
                foreach (string name in new[] { "GsacSplats", "GsacColours", "GsacKeys", "GsacLatest" }) draws.Add(number(Player.Buffer(asked.matProps, Shader.PropertyToID(name))));
                draws.Add(count);
            };
            Player.Frame(people.ToArray())();
            dump.Put("steps", steps.ToArray());
            dump.Put("draws", draws.ToArray());
            var places = new List<float>();
            people.Add(camera.gameObject);
            foreach (GameObject o in people)
            {
                Matrix4x4 m = o.transform.localToWorldMatrix;
                for (int r = 0; r < 3; r++) Put(places, m.GetRow(r));
            }
            dump.Put("places", places.ToArray());
        }
    }

    /// <summary>Dispatches by name, and draws, as people meet, rest and part; what a headset's budget leaves; buffers at the end.</summary>
    public static void Count(string file)
    {
        byte[] bytes = File.ReadAllBytes(file);
        var people = new List<GameObject>();
        for (int i = 0; i < 4; i++)
        {
            people.Add(GsacLoader.Load(bytes, "person").gameObject);
            people[i].transform.SetPositionAndRotation(new Vector3(i * 0.4f, 0, 0), Quaternion.identity);
        }
        Camera camera = Player.AddCamera("eye");
        camera.transform.SetPositionAndRotation(new Vector3(0, 1, 6), Quaternion.Euler(0, 180, 0));
        int joins = 0, others = 0;
        var draws = new List<int>();
        Player.OnDispatch = (shader, kernel, groups) =>
        {
            if (Player.KernelName(kernel) == "Join") joins++;
            else others++;
        };
        Player.OnDraw = (asked, indices, count) => draws.Add(count / 6);
        Action frame = Player.Frame(people.ToArray());
        Action<string, Action> tell = (what, act) =>
        {
            act();
            joins = others = 0;
            draws.Clear();
            frame();
            Console.WriteLine(what + ": " + joins + " " + others + " " + string.Join(" ", draws));
        };
        tell("four together", () => { });
        tell("at rest", () => { });
        tell("one turns", () => people[2].transform.SetPositionAndRotation(new Vector3(0.8f, 0, 0), Quaternion.Euler(0, 20, 0)));
        tell("camera turns", () => camera.transform.SetPositionAndRotation(new Vector3(0, 1, 6), Quaternion.Euler(0, 181, 0)));
        tell("one of another tint", () => people[0].GetComponent<GsacRenderer>().Tint = new Color(1, 0.5f, 1, 1));
        tell("two by two", () =>
        {
            people[0].GetComponent<GsacRenderer>().Tint = Color.white;
            for (int i = 0; i < 4; i++) people[i].transform.SetPositionAndRotation(new Vector3(i < 2 ? -1.5f - 0.3f * i : 1.5f + 0.3f * i, 0, 0), Quaternion.identity);
        });
        tell("two by two at rest", () => { });
        tell("all apart", () => { for (int i = 0; i < 4; i++) people[i].transform.SetPositionAndRotation(new Vector3(0, 0, i * -6f), Quaternion.identity); });
        Player.SetEyes(camera, new[] { 1.7320508f, 1.7320508f });
        tell("headset", () => { });
        int all = 0;
        foreach (int count in draws) all += count;
        tell("nine tenths of it", () => GsacCameras.MostInHeadset = all * 9 / 10);
        tell("next to nothing", () => GsacCameras.MostInHeadset = 1);
        GsacCameras.MostInHeadset = 0;
        foreach (GameObject o in people)
        {
            Player.Call(o.GetComponent<GsacRenderer>(), "OnDisable");
            Player.Call(o.GetComponent<GsacAvatar>(), "OnDisable");
        }
        Console.WriteLine("buffers: " + Player.BuffersAlive);
    }
}
