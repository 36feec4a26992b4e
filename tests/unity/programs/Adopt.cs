using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using Gsac;
using UnityEditor;
using UnityEditor.AssetImporters;
using UnityEditor.Build.Reporting;
using UnityEngine;
using UnityEngine.SceneManagement;

/// <summary>What a studio does with the package's people: files of the project, scenes, loading.</summary>
public static class Adopt
{
    static GsacAvatar Imported(string file)
    {
        var context = new AssetImportContext { assetPath = file };
        new GsacImporter().OnImportAsset(context);
        AssetDatabase.Project[file] = context.mainObject;
        return ((GameObject)context.mainObject).GetComponent<GsacAvatar>();
    }

    /// <summary>People of the project in a scene that names nobody: edited, played, built.</summary>
    public static void Cast(string file)
    {
        System.Runtime.CompilerServices.RuntimeHelpers.RunClassConstructor(typeof(GsacCastFiller).TypeHandle);
        var nobody = new GameObject("People").AddComponent<GsacCast>();
        Console.WriteLine("standing " + nobody.Standing.Length + " " + Player.Errors[0]);
        Imported(file);
        Player.SetPlaying(false);
        var cast = new GameObject("People").AddComponent<GsacCast>();
        Console.WriteLine("edited " + cast.Standing.Length + " " + cast.First.gameObject.hideFlags);
        Player.Call(cast, "OnDisable");
        Player.SetPlaying(true);
        Player.SetField(cast, "count", 5);
        Player.Call(cast, "OnEnable");
        Player.AddCamera("eye").transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        Player.Frame(Array.ConvertAll(cast.Standing, a => a.gameObject))();
        Console.WriteLine("played " + cast.Standing.Length + " " + cast.First.gameObject.hideFlags + " draws " + draws);
        foreach (GsacAvatar avatar in cast.Standing)
        {
            Vector3 p = avatar.transform.position;
            Console.WriteLine(string.Format(CultureInfo.InvariantCulture, "place {0} {1} {2}", p.x, p.y, p.z));
        }
        var scene = new Scene { Roots = new List<GameObject> { cast.gameObject } };
        new GsacCastFiller().OnProcessScene(scene, null);
        Console.WriteLine("named " + cast.People.Length);
        new GsacCastFiller().OnProcessScene(scene, new BuildReport());
        Console.WriteLine("named " + cast.People.Length);
    }
}
